// SPDX-License-Identifier: Apache-2.0
// Gives a rank access to all frames of a take: its own from archives, others by request to the
// owner of the camera. Requests can be for a whole JPEG, for its layout, or for single segments
// between restart markers, so that only the needed parts are sent. Pictures of more than 8 bits are
// sent whole, as they are stored, and decoded by the rank that asked. Cost: one message each way
// per request.
#include "farm/ranks/rank_takes.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/resources.h"

namespace raystage::farm {
namespace {

namespace fs = std::filesystem;

/// Returns a tag for a reply to this rank, unique until the reply has arrived.
int new_reply_tag() {
  static std::atomic<std::uint32_t> next = 0;
  return kFirstReplyTag + static_cast<int>(next++ % (1U << 29));
}

/// The frames of a camera whose archive is on another rank.
class FetchedFrames : public store::RemoteFrames {
 public:
  FetchedFrames(const RankArchives& archives, int camera, std::vector<std::uint64_t> recorded_xxh3)
      : archives_(archives), camera_(camera), recorded_xxh3_(std::move(recorded_xxh3)) {}

  store::FrameBytes jpeg(int frame) const override {
    return as_bytes(ask(FrameRequest::Kind::kWhole, frame, {}).bytes);
  }

  store::JpegLayout layout(int frame) const override {
    FrameReply reply = ask(FrameRequest::Kind::kLayout, frame, {});
    if (!reply.layout) throw damaged(frame);
    return *std::move(reply.layout);
  }

  /// Returns the frame with zeros for other segments, which the decoder does not read.
  store::FrameBytes jpeg_part(int frame, const store::JpegLayout& layout,
                              const store::McuMask& wanted) const override {
    const std::vector<std::uint32_t> segments = segments_with(layout, wanted);
    const FrameReply reply = ask(FrameRequest::Kind::kSegments, frame, segments);
    std::span<const std::byte> rest(reply.bytes);
    if (layout.scan_offset > rest.size()) throw damaged(frame);  // the layout limits only its scan
    MessageBytes jpeg(layout.scan_end + 2);
    const auto copy = [&](std::size_t begin, std::size_t end) {
      if (begin > end || end > jpeg.size() || end - begin > rest.size()) throw damaged(frame);
      std::ranges::copy(rest.first(end - begin), jpeg.begin() + begin);
      rest = rest.subspan(end - begin);
    };
    copy(0, layout.scan_offset);
    for (const std::uint32_t segment : segments) {
      copy(layout.segment_offset[segment], layout.segment_offset[segment + 1]);
    }
    return as_bytes(std::move(jpeg));
  }

  std::uint64_t recorded_xxh3(int frame) const override {
    const auto i = static_cast<std::size_t>(frame);
    return i < recorded_xxh3_.size() ? recorded_xxh3_[i] : 0;
  }

 private:
  static store::FrameBytes as_bytes(MessageBytes bytes) {
    return store::FrameBytes(std::make_shared<const std::vector<std::byte>>(std::move(bytes)));
  }

  static std::vector<std::uint32_t> segments_with(const store::JpegLayout& layout,
                                                  const store::McuMask& wanted) {
    std::vector<std::uint32_t> segments;
    for (std::size_t mcu = 0; mcu < wanted.size(); ++mcu) {
      if (wanted[mcu] == 0) continue;
      const auto segment =
          static_cast<std::uint32_t>(mcu / static_cast<std::size_t>(layout.restart_interval));
      if (segments.empty() || segments.back() != segment) segments.push_back(segment);
    }
    return segments;
  }

  Error damaged(int frame) const {
    return Error::failed("a fetched part of the frame is missing or has the wrong size",
                         fmt::format("camera {} frame {}", camera_, frame),
                         "Check the network between the hosts and render again");
  }

  FrameReply ask(FrameRequest::Kind kind, int frame, std::vector<std::uint32_t> segments) const {
    FrameRequest request;
    request.kind = kind;
    request.frame = frame;
    request.segments = std::move(segments);
    return archives_.fetch(camera_, std::move(request));
  }

  const RankArchives& archives_;
  int camera_;
  std::vector<std::uint64_t> recorded_xxh3_;
};

}  // namespace

void RankArchives::set_camera_owners(std::vector<int> camera_owners,
                                     std::vector<TakeTable::Camera> cameras) {
  camera_owners_ = std::move(camera_owners);
  cameras_ = std::move(cameras);
}

std::optional<store::ArchiveReader> RankArchives::open(int camera) const {
  const auto index = static_cast<std::size_t>(camera);
  if (index < is_local_.size() && is_local_[index]) return std::nullopt;
  if (is_missing(camera))
    return store::ArchiveReader(store::ArchiveWriter::Description(), {}, nullptr);
  TakeTable::Camera known = index < cameras_.size() ? cameras_[index] : TakeTable::Camera{};
  return store::ArchiveReader(
      known.description, std::move(known.frames),
      std::make_shared<const FetchedFrames>(*this, camera, std::move(known.recorded_xxh3)),
      unpacked_);
}

bool RankArchives::is_missing(int camera) const {
  const auto index = static_cast<std::size_t>(camera);
  return index < camera_owners_.size() && camera_owners_[index] < 0;
}

FrameReply RankArchives::fetch(int camera, FrameRequest request) const {
  const int owner = camera_owners_.at(camera);
  request.reply_tag = new_reply_tag();
  request.take = take_number_;
  request.camera = camera;
  world_.send(owner, kFrameRequestTag, encode(request));
  const MessageBytes message = world_.receive(owner, request.reply_tag);
  ++requests_;
  bytes_ += static_cast<std::int64_t>(message.size());
  FrameReply reply = decode_frame_reply(message);
  if (reply.error.empty()) return reply;
  throw Error::bad_input(reply.error, fmt::format("rank {}", owner),
                         "Run `raystage verify` on that host's take");
}

RankTake open_rank_take(MpiWorld& world, int number, const fs::path& folder) {
  RankTake opened;
  opened.archives = std::make_shared<RankArchives>(world, number);
  try {
    auto take = std::make_unique<store::Take>(folder, opened.archives);
    const std::string documents = read_file(folder / "take.json") + read_file(folder / "rig.json");
    opened.table.documents =
        fmt::format("{:016x}", XXH3_64bits(documents.data(), documents.size()));
    std::vector<bool> is_local;
    for (const auto& camera : take->document().cameras) {
      is_local.push_back(exists(take->file(camera.archive)));
    }
    opened.archives->set_local_cameras(is_local);
    for (std::size_t i = 0; i < is_local.size(); ++i) {
      TakeTable::Camera camera;
      camera.is_local = is_local[i];
      if (camera.is_local) {
        const store::ArchiveReader& archive = take->archive(static_cast<int>(i));
        camera.description = archive.description();
        camera.frames.assign(archive.frames().begin(), archive.frames().end());
        // Other ranks receive pictures as they are stored, other frames as JPEGs, also packed ones.
        for (std::size_t frame = 0; frame < camera.frames.size(); ++frame) {
          const auto index = static_cast<int>(frame);
          camera.frames[frame].xxh3 = archive.jpeg_xxh3(index);
          if (store::is_temporal(camera.description.codec)) {
            camera.recorded_xxh3.push_back(archive.recorded_xxh3(index));
          }
        }
      }
      opened.table.cameras.push_back(std::move(camera));
    }
    opened.take = std::move(take);
  } catch (const Error& error) {
    opened.table = {};
    opened.table.error = fmt::format("{}: {}", error.where(), error.what_happened());
  }
  return opened;
}

fs::path local_take_folder(const std::string& folder, std::span<const PathMappingRule> rules,
                           int rank) {
  std::string mine = map_path(folder, rules);
  const auto replace = [&](std::string_view name, const std::string& value) {
    for (std::size_t at = mine.find(name); at != std::string::npos; at = mine.find(name, at)) {
      mine.replace(at, name.size(), value);
      at += value.size();
    }
  };
  replace("{rank}", std::to_string(rank));
  replace("{host}", host_name());
  return mine;
}

FrameService::FrameService(MpiWorld& world)
    : world_(world), thread_([this](const std::stop_token& stop) { run(stop); }) {}

FrameService::~FrameService() {
  thread_.request_stop();
  thread_.join();
}

void FrameService::add(int number, const store::Take& take) {
  const std::scoped_lock lock(mutex_);
  takes_.resize(std::max(takes_.size(), static_cast<std::size_t>(number) + 1));
  takes_[number] = &take;
}

void FrameService::run(const std::stop_token& stop) {
  while (const auto received = world_.receive_any(kFrameRequestTag, stop)) {
    FrameRequest request;
    FrameReply reply;
    try {
      request = decode_frame_request(received->message);
      reply = answer(request);
    } catch (const std::exception& error) {
      reply = {};
      reply.error = error.what();
    }
    // The tag of the reply that its sender waits for is not known: it would wait without end.
    if (request.reply_tag < kFirstReplyTag) {
      world_.abort(static_cast<int>(ExitCode::kFailed),
                   fmt::format("rank {}: {}", received->from, reply.error));
    }
    world_.send(received->from, request.reply_tag, encode(reply));
  }
}

FrameReply FrameService::answer(const FrameRequest& request) {
  const store::Take* take = nullptr;
  {
    const std::scoped_lock lock(mutex_);
    const auto number = static_cast<std::size_t>(request.take);
    if (number < takes_.size()) take = takes_[number];
  }
  const std::string where = fmt::format("camera {} frame {}", request.camera, request.frame);
  const bool is_known =
      take != nullptr && request.camera >= 0 && request.camera < take->camera_count() &&
      !take->archive(request.camera).is_remote() && request.frame >= 0 &&
      static_cast<std::size_t>(request.frame) < take->archive(request.camera).frames().size();
  if (!is_known) throw Error::failed("the rank does not have the frame", where, "Render again");
  const store::ArchiveReader& archive = take->archive(request.camera);
  const bool is_picture = archive.description().codec == store::FrameCodec::kPicture;
  if (is_picture && request.kind != FrameRequest::Kind::kWhole) {
    throw Error::failed("a part of a picture was requested, which has none", where, "Render again");
  }
  const store::FrameBytes jpeg =
      is_picture ? archive.stored(request.frame) : archive.jpeg(request.frame);
  FrameReply reply;
  const auto append = [&](std::size_t begin, std::size_t end) {
    const auto part = jpeg.bytes().subspan(begin, end - begin);
    reply.bytes.insert(reply.bytes.end(), part.begin(), part.end());
  };
  if (request.kind == FrameRequest::Kind::kWhole) {
    append(0, jpeg.size());
    return reply;
  }
  const store::JpegLayout layout = store::parse_jpeg_layout(jpeg, where);
  if (request.kind == FrameRequest::Kind::kLayout) {
    reply.layout = layout;
    return reply;
  }
  append(0, layout.scan_offset);
  for (const std::uint32_t segment : request.segments) {
    if (segment >= static_cast<std::uint32_t>(layout.segment_count())) {
      throw Error::failed("a segment that the frame lacks was requested", where, "Render again");
    }
    append(layout.segment_offset[segment],
           std::min<std::size_t>(layout.segment_offset[segment + 1], jpeg.size()));
  }
  return reply;
}

}  // namespace raystage::farm
