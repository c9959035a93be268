// SPDX-License-Identifier: Apache-2.0
// Caches decoded and corrected frames in a memory budget, least recently used first out. A frame is
// decoded whole or in MCUs (decode.h, incremental_decode.h), then corrected
// (photometric_correction.h) and keyed (frame_matte.h). Output: 16-bit R, G, B, A, premultiplied, 8
// bytes per pixel.
#include "store/processing/frames/frame_cache.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <deque>
#include <list>
#include <map>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "store/processing/frames/flow_luma.h"
#include "store/processing/frames/frame_pages.h"
#include "store/processing/frames/incremental_decode.h"
#include "store/processing/frames/photometric_correction.h"
#include "store/processing/motion/frame_interpolation.h"

namespace raystage::store {
namespace {

using Key = std::pair<int, int>;  // camera, frame

struct Entry {
  std::mutex decoding;
  std::shared_ptr<const JpegLayout> layout;
  std::shared_ptr<const DecodedFrame> frame;
  FrameCache::FetchGroup fetch_group = FrameCache::kUngrouped;  // of the latest partial decode
  std::list<Key>::iterator position;                            // in State::by_use
};

/// The latest read-ahead requests of a camera.
struct ReadAhead {
  static constexpr std::size_t kMaxRequests = 16;  // the largest number of frames in flight
  bool is_in_use = false;                          // whether a frame was fetched
  std::deque<int> requested;                       // frames not in memory yet, the newest last
};

rig::PictureSize size_of(const rig::Rig::Camera& camera) {
  return {camera.model.width(), camera.model.height()};
}

double max_linear_light_of_take(const Take& take) {
  double light = 1;
  for (std::size_t i = 0; i < take.rig().cameras.size(); ++i) {
    const rig::Rig::Camera& camera = take.rig().cameras[i];
    const auto& pixels = take.document().cameras[i].pixels;
    light = std::max(
        light, pixels ? max_linear_light(camera.photometric, size_of(camera), *pixels)
                      : max_linear_light(camera.photometric, size_of(camera), take.document()));
  }
  return light;
}

/// Returns the scale of the take's levels where `wanted` is asked for.
BlendSpace blend_space_of_take(const Take& take, BlendSpace wanted, double full_scale) {
  const bool has_highlights = full_scale > 1 && take.document().has_deep_pixels();
  return wanted == BlendSpace::kPerceptual && has_highlights ? BlendSpace::kHighRange : wanted;
}

/// Returns whether two cameras have the same table of samples of more than 8 bits.
bool is_alike(const Take& take, std::size_t a, std::size_t b) {
  const auto& cameras = take.document().cameras;
  if (!cameras[a].pixels || !cameras[b].pixels) return false;
  schemas::PixelEncoding first = *cameras[a].pixels;
  first.peak = cameras[b].pixels->peak;  // full scale, which they share, limits light
  const rig::Rig::Camera &one = take.rig().cameras[a], &other = take.rig().cameras[b];
  const rig::PictureSize size = size_of(one), other_size = size_of(other);
  return first == *cameras[b].pixels && one.photometric == other.photometric &&
         size.width == other_size.width && size.height == other_size.height;
}

bool contains(const DecodedFrame& frame, const McuMask& wanted) {
  if (frame.decoded.empty()) return true;
  if (wanted.empty()) return false;
  return std::ranges::equal(wanted, frame.decoded,
                            [](auto needed, auto has) { return needed == 0 || has != 0; });
}

}  // namespace

struct FrameCache::State {
  State(const Take& of_take, std::size_t budget_bytes, double with_full_scale, BlendSpace in_space,
        std::shared_ptr<const FrameMatte> with_matte,
        std::shared_ptr<const InterpolatedFrames> with_interpolated)
      : take(of_take),
        budget(budget_bytes),
        full_scale(with_full_scale),
        space(blend_space_of_take(of_take, in_space, with_full_scale)),
        matte(std::move(with_matte)),
        interpolated(std::move(with_interpolated)) {}

  const Take& take;
  std::size_t budget;
  double full_scale;
  BlendSpace space;
  std::shared_ptr<const FrameMatte> matte;
  std::shared_ptr<const InterpolatedFrames> interpolated;
  bool is_white = false;
  std::vector<PhotometricCorrection> corrections;
  tbb::enumerable_thread_specific<JpegDecoder> decoders;
  tbb::enumerable_thread_specific<OpticalFlowEstimator> flow_estimators;
  std::once_flag has_interpolated;
  std::vector<std::uint8_t> codes;  // set once there are interpolated frames
  std::atomic<FetchGroup> last_fetch_group = kUngrouped;
  std::atomic<std::int64_t> decode_nanoseconds = 0, jpeg_bytes = 0;

  std::mutex mutex;  // guards the members below
  std::map<Key, std::shared_ptr<Entry>> entries;
  std::list<Key> by_use;  // most recent first
  std::size_t bytes = 0;
  std::vector<ReadAhead> ahead;  // per camera
  int read_ahead = 0;
  /// Buffers of evicted frames, by size: allocating new pages costs more than reusing them.
  std::multimap<std::size_t, std::unique_ptr<std::uint16_t[]>> spare;
  std::size_t spare_bytes = 0;
  std::map<std::pair<int, int>, std::shared_ptr<const DecodedFrame>> white_frames;  // by size

  /// Returns whether a camera's frames have more than 8 bits; they can only be decoded whole.
  bool is_deep(int camera) const {
    return take.document().cameras[static_cast<std::size_t>(camera)].pixels.has_value();
  }

  /// Returns the layout of a picture that has no JPEG.
  JpegLayout whole_layout(int camera) const {
    const rig::CameraModel& model = take.rig().cameras[camera].model;
    JpegLayout layout;
    layout.width = model.width();
    layout.height = model.height();
    layout.mcus_per_row = (layout.width + layout.mcu_width - 1) / layout.mcu_width;
    layout.mcu_rows = (layout.height + layout.mcu_height - 1) / layout.mcu_height;
    return layout;
  }

  std::shared_ptr<const DecodedFrame> white_frame(int camera) {
    const JpegLayout layout = whole_layout(camera);
    const std::scoped_lock lock(mutex);
    auto& known = white_frames[{layout.width, layout.height}];
    if (known) return known;
    auto frame = std::make_shared<DecodedFrame>();
    frame->width = layout.width;
    frame->height = layout.height;
    const std::size_t pixels = static_cast<std::size_t>(layout.width) * (layout.height + 1) + 1;
    frame->rgba = std::make_unique_for_overwrite<std::uint16_t[]>(pixels * 4);
    std::fill_n(frame->rgba.get(), pixels * 4, std::uint16_t{65535});
    known = std::move(frame);
    return known;
  }

  std::shared_ptr<Entry> entry(const Key& key) {
    const std::scoped_lock lock(mutex);
    auto& found = entries[key];
    if (!found) {
      found = std::make_shared<Entry>();
      by_use.push_front(key);
      found->position = by_use.begin();
    } else {
      by_use.splice(by_use.begin(), by_use, found->position);
    }
    return found;
  }

  std::string name_of(const Key& key) const {
    return take.document().cameras[key.first].archive + " frame " + std::to_string(key.second);
  }

  const JpegLayout& layout_of(const Key& key, Entry& held) {
    if (!held.layout && (InterpolatedFrames::is_interpolated(key.second) || is_deep(key.first))) {
      held.layout = std::make_shared<const JpegLayout>(whole_layout(key.first));
    }
    if (!held.layout) {
      auto layout =
          std::make_shared<JpegLayout>(take.archive(key.first).layout(key.second, name_of(key)));
      const rig::CameraModel& model = take.rig().cameras[key.first].model;
      if (layout->width != model.width() || layout->height != model.height()) {
        throw Error::bad_input("the frame has " + std::to_string(layout->width) + "x" +
                                   std::to_string(layout->height) + " pixels, its camera " +
                                   std::to_string(model.width()) + "x" +
                                   std::to_string(model.height()),
                               name_of(key), "Import the take again with the right camera sizes");
      }
      held.layout = std::move(layout);
    }
    return *held.layout;
  }

  std::unique_ptr<std::uint16_t[]> allocate(std::size_t bytes_wanted) {
    const std::scoped_lock lock(mutex);
    const auto found = spare.find(bytes_wanted);
    if (found == spare.end()) {
      return std::make_unique_for_overwrite<std::uint16_t[]>(bytes_wanted / 2);
    }
    auto memory = std::move(found->second);
    spare.erase(found);
    spare_bytes -= bytes_wanted;
    return memory;
  }

  /// Returns a shared frame whose buffer returns to `spare` when its last user releases it.
  std::shared_ptr<const DecodedFrame> share(DecodedFrame&& frame,
                                            const std::shared_ptr<State>& self) {
    return {new DecodedFrame(std::move(frame)),
            [weak = std::weak_ptr<State>(self)](DecodedFrame* dead) {
              const std::unique_ptr<DecodedFrame> owner(dead);
              if (const auto state = weak.lock()) state->recycle(*owner);
            }};
  }

  void recycle(DecodedFrame& frame) {
    const std::scoped_lock lock(mutex);
    if (spare_bytes + frame.bytes > max_spare_bytes()) return;
    spare_bytes += frame.bytes;
    spare.emplace(frame.bytes, std::move(frame.rgba));
  }

  std::span<std::uint16_t> pixels_of(const DecodedFrame& frame) const {
    return {frame.rgba.get(), static_cast<std::size_t>(frame.width) * frame.height * 4};
  }

  DecodedFrame unset_frame(const JpegLayout& layout) {
    DecodedFrame frame;
    frame.width = layout.width;
    frame.height = layout.height;
    const std::size_t pixels = static_cast<std::size_t>(layout.width) * (layout.height + 1) + 1;
    frame.bytes = pixels * 4 * sizeof(std::uint16_t);
    frame.rgba = allocate(frame.bytes);
    const std::size_t used = pixels_of(frame).size();
    std::fill_n(frame.rgba.get() + used, pixels * 4 - used, std::uint16_t{0});
    return frame;
  }

  std::int64_t decode_into(const DecodedFrame& frame, const Key& key, const JpegLayout& layout,
                           const McuMask& mcus) {
    const auto start = std::chrono::steady_clock::now();
    const PhotometricCorrection& correction = corrections[key.first];
    if (is_deep(key.first)) return decode_deep_into(frame, key, layout, mcus);
    const FrameBytes jpeg = take.archive(key.first).jpeg_part(key.second, layout, mcus);
    request_pages(pixels_of(frame), layout, mcus);
    const std::int64_t decoded = decoders.local().decode_region(
        jpeg, layout, mcus, correction.table(), pixels_of(frame), name_of(key));
    correction.correct(pixels_of(frame), layout, mcus);
    if (matte) {
      key_mcus(*matte->make_keyer(key.first, key.second, {space, full_scale}), frame, layout, mcus);
    }
    decode_nanoseconds += std::chrono::duration_cast<std::chrono::nanoseconds>(
                              std::chrono::steady_clock::now() - start)
                              .count();
    jpeg_bytes += static_cast<std::int64_t>(jpeg.size());
    return decoded;
  }

  /// Decodes a whole frame of more than 8 bits.
  std::int64_t decode_deep_into(const DecodedFrame& frame, const Key& key, const JpegLayout& layout,
                                const McuMask& mcus) {
    const auto start = std::chrono::steady_clock::now();
    const ArchiveReader& archive = take.archive(key.first);
    const DeepPicture picture = archive.picture(key.second);
    request_pages(pixels_of(frame), layout, mcus);
    corrections[key.first].convert(picture, pixels_of(frame));
    if (matte) {
      key_mcus(*matte->make_keyer(key.first, key.second, {space, full_scale}), frame, layout, mcus);
    }
    decode_nanoseconds += std::chrono::duration_cast<std::chrono::nanoseconds>(
                              std::chrono::steady_clock::now() - start)
                              .count();
    jpeg_bytes += static_cast<std::int64_t>(archive.frames()[key.second].size);
    return std::int64_t{layout.width} * layout.height;
  }

  void key_mcus(const FrameKeyer& key, const DecodedFrame& frame, const JpegLayout& layout,
                const McuMask& mcus) const {
    for (int y = 0; y < frame.height; ++y) {
      const std::uint8_t* const row = &mcus[y / layout.mcu_height * layout.mcus_per_row];
      for (int begin = 0; begin < layout.mcus_per_row;) {
        const auto end =
            static_cast<int>(std::find(row + begin, row + layout.mcus_per_row, 0) - row);
        if (end > begin) {
          const int left = begin * layout.mcu_width;
          const int right = std::min(frame.width, end * layout.mcu_width);
          const auto first = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                             static_cast<std::size_t>(left);
          key.key_row(
              left, y,
              pixels_of(frame).subspan(first * 4, static_cast<std::size_t>(right - left) * 4));
        }
        begin = end + 1;
      }
    }
  }

  DecodedFrame decode(const Key& key, const JpegLayout& layout, const McuMask& wanted,
                      std::int64_t& pixels_decoded) {
    DecodedFrame frame = unset_frame(layout);
    if (std::ranges::find(wanted, 0) != wanted.end()) frame.decoded = wanted;
    pixels_decoded += decode_into(frame, key, layout, wanted);
    return frame;
  }

  /// Returns the frame between two frames, which are whole.
  DecodedFrame interpolate(const JpegLayout& layout, const DecodedFrame& a, const DecodedFrame& b,
                           const InstantBetween& instant) {
    const auto start = std::chrono::steady_clock::now();
    std::call_once(has_interpolated, [&] {
      use_one_opencv_thread();
      codes = flow_codes({space, full_scale});
    });
    DecodedFrame frame = unset_frame(layout);
    const Luma luma_a = flow_luma(pixels_of(a), a.width, a.height, codes),
               luma_b = flow_luma(pixels_of(b), b.width, b.height, codes);
    OpticalFlowEstimator& estimator = flow_estimators.local();
    const FlowField b_from_a = estimator.estimate(luma_a, luma_b),
                    a_from_b = estimator.estimate(luma_b, luma_a);
    interpolate_levels({luma_a, luma_b, b_from_a, a_from_b}, instant, pixels_of(a), pixels_of(b),
                       pixels_of(frame));
    decode_nanoseconds += std::chrono::duration_cast<std::chrono::nanoseconds>(
                              std::chrono::steady_clock::now() - start)
                              .count();
    return frame;
  }

  /// Returns a copy of `held`, which other threads may be using, with the `wanted` MCUs added.
  DecodedFrame decode_more(const Key& key, const JpegLayout& layout, const DecodedFrame& held,
                           const McuMask& wanted, std::int64_t& pixels_decoded) {
    const IncrementalDecode added(layout, held.decoded, wanted);
    DecodedFrame frame = unset_frame(layout);
    if (std::ranges::find(added.together(), 0) != added.together().end()) {
      frame.decoded = added.together();
    }
    pixels_decoded += decode_into(frame, key, layout, added.to_decode());
    added.copy_held(pixels_of(held), pixels_of(frame));
    return frame;
  }

  /// Keeps a decoded frame, unless its entry was evicted meanwhile.
  void keep(const Key& key, const std::shared_ptr<Entry>& entry,
            const std::shared_ptr<const DecodedFrame>& decoded) {
    const std::scoped_lock lock(mutex);
    const auto kept = entries.find(key);
    if (kept == entries.end() || kept->second != entry) return;
    bytes += decoded->bytes;
    if (entry->frame) bytes -= entry->frame->bytes;
    entry->frame = decoded;
    std::erase(ahead[key.first].requested, key.second);
  }

  /// Starts the camera's waiting read-ahead requests at its first fetch.
  void start_waiting_requests(int camera, int fetched) {
    std::deque<int> waiting;
    {
      const std::scoped_lock lock(mutex);
      ReadAhead& of_camera = ahead[camera];
      if (std::exchange(of_camera.is_in_use, true)) return;
      waiting = of_camera.requested;
      std::erase(waiting, fetched);
      read_ahead += static_cast<int>(waiting.size());
    }
    for (const int frame : waiting) take.archive(camera).read_ahead(frame);
  }

  std::size_t max_spare_bytes() const { return budget / 8; }
  std::size_t max_unpacked_bytes() const { return budget / 8; }

  /// Evicts the least recently used frames; users of a frame keep it alive.
  void evict() {
    std::vector<std::shared_ptr<const DecodedFrame>> dropped;  // released after the lock
    const std::scoped_lock lock(mutex);
    const std::size_t unpacked =
        std::min(take.unpacked_frames().bytes_held(), max_unpacked_bytes());
    while (bytes > budget - max_spare_bytes() - unpacked && by_use.size() > 1) {
      const auto oldest = entries.find(by_use.back());
      if (oldest->second->frame) {
        bytes -= oldest->second->frame->bytes;
        dropped.push_back(std::move(oldest->second->frame));
      }
      by_use.pop_back();
      entries.erase(oldest);
    }
  }
};

FrameCache::FrameCache(const Take& take, std::size_t budget_bytes, BlendSpace space,
                       std::shared_ptr<const FrameMatte> matte,
                       std::shared_ptr<const InterpolatedFrames> interpolated)
    : state_(std::make_shared<State>(take, budget_bytes, max_linear_light_of_take(take), space,
                                     std::move(matte), std::move(interpolated))) {
  const CodeScale scale{state_->space, state_->full_scale};
  LevelTable levels;
  for (std::size_t i = 0; i < take.rig().cameras.size(); ++i) {
    const rig::Rig::Camera& camera = take.rig().cameras[i];
    const auto& pixels = take.document().cameras[i].pixels;
    const bool by_pixel = needs_per_pixel_correction(camera.photometric) ||
                          (pixels && pixels->chromaticities.has_value());
    if (!levels && by_pixel) levels = make_level_table(scale.space);
    if (!pixels) {
      state_->corrections.emplace_back(camera.photometric, size_of(camera), take.document(), scale,
                                       levels);
    } else if (i > 0 && is_alike(take, i - 1, i)) {
      const PhotometricCorrection same = state_->corrections.back();  // shares its tables
      state_->corrections.push_back(same);
    } else {
      state_->corrections.emplace_back(camera.photometric, size_of(camera), *pixels, scale, levels);
    }
  }
  state_->ahead.resize(take.rig().cameras.size());
  take.unpacked_frames().set_budget(state_->max_unpacked_bytes());
}

FrameCache FrameCache::white(const Take& take, BlendSpace space) {
  auto state = std::make_shared<State>(take, 0, 1, space, nullptr, nullptr);
  state->is_white = true;
  state->ahead.resize(take.rig().cameras.size());
  return FrameCache(std::move(state));
}

FrameCache FrameCache::renumbered(std::vector<int> cameras) const {
  FrameCache result(state_);
  for (int& camera : cameras) camera = camera_of_take(camera);
  result.cameras_ = std::move(cameras);
  return result;
}

FrameCache::FrameCache(FrameCache&&) noexcept = default;
FrameCache::~FrameCache() = default;

std::shared_ptr<const JpegLayout> FrameCache::layout(int camera, int frame) {
  camera = camera_of_take(camera);
  if (state_->is_white) return std::make_shared<const JpegLayout>(state_->whole_layout(camera));
  const Key key{camera, frame};
  const auto entry = state_->entry(key);
  const std::scoped_lock decoding(entry->decoding);
  state_->layout_of(key, *entry);
  return entry->layout;
}

FrameCache::FetchGroup FrameCache::new_fetch_group() { return ++state_->last_fetch_group; }

std::shared_ptr<const DecodedFrame> FrameCache::fetch(int camera, int frame, const McuMask& wanted,
                                                      std::int64_t& pixels_decoded,
                                                      FetchGroup look) {
  camera = camera_of_take(camera);
  if (state_->is_white) return state_->white_frame(camera);
  const Key key{camera, frame};
  const auto entry = state_->entry(key);
  const std::scoped_lock decoding(entry->decoding);
  state_->start_waiting_requests(camera, frame);
  std::shared_ptr<const DecodedFrame> held;
  {
    const std::scoped_lock lock(state_->mutex);
    held = entry->frame;
  }
  if (held && contains(*held, wanted)) return held;

  if (InterpolatedFrames::is_interpolated(frame)) {
    // Holding the lock of this frame, locks those of its sources, which never lock others.
    const InterpolatedFrames::Sources sources = state_->interpolated->sources_of(frame);
    FrameCache of_take(state_);
    const auto a = of_take.fetch(camera, sources.first, {}, pixels_decoded),
               b = of_take.fetch(camera, sources.second, {}, pixels_decoded);
    auto between = state_->share(state_->interpolate(state_->layout_of(key, *entry), *a, *b,
                                                     {sources.part, sources.line_part}),
                                 state_);
    state_->keep(key, entry, between);
    state_->evict();
    return between;
  }
  const JpegLayout& layout = state_->layout_of(key, *entry);
  const bool adds =
      held && look != kUngrouped && look == entry->fetch_group && layout.regions_decodable();
  const bool whole = wanted.empty() || (held && !adds) || state_->is_deep(camera);
  const McuMask all(whole ? static_cast<std::size_t>(layout.mcu_count()) : 0, 1);
  auto decoded = state_->share(
      adds && !whole ? state_->decode_more(key, layout, *held, wanted, pixels_decoded)
                     : state_->decode(key, layout, whole ? all : wanted, pixels_decoded),
      state_);
  entry->fetch_group = look;
  state_->keep(key, entry, decoded);
  held.reset();
  state_->evict();
  return decoded;
}

std::optional<InterpolatedFrames::Sources> FrameCache::sources_of(int frame) const {
  if (!InterpolatedFrames::is_interpolated(frame)) return std::nullopt;
  return state_->interpolated->sources_of(frame);
}

void FrameCache::read_ahead(int camera, int frame) {
  if (const auto sources = sources_of(frame)) {
    read_ahead(camera, sources->first);
    read_ahead(camera, sources->second);
    return;
  }
  camera = camera_of_take(camera);
  {
    const std::scoped_lock lock(state_->mutex);
    const auto found = state_->entries.find({camera, frame});
    if (found != state_->entries.end() && found->second->frame) return;
    ReadAhead& ahead = state_->ahead[camera];
    if (std::ranges::find(ahead.requested, frame) != ahead.requested.end()) return;
    ahead.requested.push_back(frame);
    if (ahead.requested.size() > ReadAhead::kMaxRequests) ahead.requested.pop_front();
    if (!ahead.is_in_use) return;
    ++state_->read_ahead;
  }
  state_->take.archive(camera).read_ahead(frame);
}

bool FrameCache::is_fully_decoded(int camera, int frame) {
  if (state_->is_white) return true;
  const std::scoped_lock lock(state_->mutex);
  const auto found = state_->entries.find({camera_of_take(camera), frame});
  return found != state_->entries.end() && found->second->frame &&
         found->second->frame->decoded.empty();
}

BlendSpace FrameCache::blend_space() const { return state_->space; }

bool FrameCache::has_matte() const { return state_->matte != nullptr; }

CodeScale FrameCache::scale() const { return {state_->space, state_->full_scale}; }

double FrameCache::full_scale() const { return state_->full_scale; }

int FrameCache::frames_read_ahead() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->read_ahead;
}

DecodeCosts FrameCache::decode_costs() const {
  return {1e-9 * static_cast<double>(state_->decode_nanoseconds), state_->jpeg_bytes};
}

std::size_t FrameCache::bytes_held() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->bytes;
}

}  // namespace raystage::store
