// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <utility>

#include "base/error.h"

namespace raystage::store {

/// What happens where the bytes of a frame are not those that were recorded.
enum class RottenFrames {
  kError,  ///< what needs the frame fails
  kAbsent  ///< its camera counts as absent at that instant
};

/// The words of every RottenFrame's what(), by which logs are searched.
inline constexpr std::string_view kRottenFrameText = "is not as it was recorded (XXH3)";

/// A frame whose bytes do not have the XXH3 of the journal.
class RottenFrame : public Error {
 public:
  RottenFrame(Error error, int frame) : Error(std::move(error)), frame_(frame) {}
  int frame() const { return frame_; }  ///< index into ArchiveReader::frames()

 private:
  int frame_;
};

}  // namespace raystage::store
