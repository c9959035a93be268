// SPDX-License-Identifier: Apache-2.0
#include "exports/source_frames.h"

#include <fmt/format.h>

#include "base/error.h"
#include "store/jpeg/encode.h"
#include "store/rotten_frame.h"

namespace raystage::exports {
namespace {

constexpr int kBlackFrame = -1, kNoFrame = -2;

std::vector<std::byte> black_jpeg(const rig::CameraModel& model) {
  store::JpegEncodeOptions options;
  options.chroma = store::JpegEncodeOptions::Chroma::k420;
  return store::encode_jpeg(store::RgbImage(model.width(), model.height()), options);
}

}  // namespace

SourceFrames::SourceFrames(const store::Take& take, const CameraFrames& frames, AbsentFrames absent,
                           DeepFrames deep_frames)
    : take_(take),
      frames_(frames),
      absent_(absent),
      has_deep_pictures_(
          deep_frames == DeepFrames::kPictures &&
          take.document().cameras[static_cast<std::size_t>(frames.camera)].pixels.has_value()) {
  counts_.id = take.document().cameras[frames.camera].id;
  counts_.absent = frames.absent;
}

/// Reads a stored frame; returns false if it is rotten.
bool SourceFrames::read(int source) {
  const store::ArchiveReader& archive = take_.archive(frames_.camera);
  if (has_deep_pictures_) {
    try {
      deep_ = archive.picture(source);
      return true;
    } catch (const store::RottenFrame&) {
      return false;
    }
  }
  const auto jpeg = archive.intact_jpeg(source);
  if (!jpeg) return false;
  bytes_.assign(jpeg->begin(), jpeg->end());
  if (archive.pixel_encoding()) ++counts_.clipped;
  return true;
}

/// Reads the bytes of a frame; returns false if there is none. Changes the frame where another one
/// stands for it.
bool SourceFrames::load(ChosenFrame& frame) {
  if (frame.source >= 0 && frame.source != loaded_) {
    if (read(frame.source)) {
      loaded_ = frame.source;
      loaded_ns_ = frame.source_ns;
      return true;
    }
    if (rotten_.insert(frame.source).second) ++counts_.rotten;  // it may be shown several times
    frame.is_held = true;
    if (absent_ == AbsentFrames::kGap) return false;
    const bool can_hold = absent_ != AbsentFrames::kBlack && loaded_ != kNoFrame;
    frame.source = can_hold ? loaded_ : kBlackFrame;
    frame.source_ns = can_hold ? loaded_ns_ : 0;
  }
  if (frame.source < 0 && loaded_ != kBlackFrame) {
    bytes_ = black_jpeg(take_.rig().cameras[frames_.camera].model);
    loaded_ = kBlackFrame;
  }
  return true;
}

std::optional<SourceFrames::Ready> SourceFrames::next() {
  while (position_ < frames_.frames.size()) {
    ChosenFrame frame = frames_.frames[position_++];
    if (!load(frame)) continue;
    ++counts_.frames;
    if (frame.is_held) ++(frame.source < 0 ? counts_.black : counts_.held);
    const bool is_deep = has_deep_pictures_ && loaded_ >= 0;
    if (is_deep) return Ready{{}, frame, &deep_};
    return Ready{bytes_, frame};
  }
  return std::nullopt;
}

const store::RgbImage& SourceFrames::picture() {
  if (decoded_ == loaded_) return picture_;
  picture_ = decoder_.decode(bytes_, counts_.id);
  const rig::CameraModel& model = take_.rig().cameras[frames_.camera].model;
  if (picture_.width != model.width() || picture_.height != model.height()) {
    throw Error::bad_input(
        fmt::format("camera \"{}\" has frames of {}x{} pixels, but {}x{} in its rig", counts_.id,
                    picture_.width, picture_.height, model.width(), model.height()),
        take_.folder().string(), "Use the rig with which the take was recorded");
  }
  decoded_ = loaded_;
  return picture_;
}

}  // namespace raystage::exports
