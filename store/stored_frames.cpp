// SPDX-License-Identifier: Apache-2.0
#include "store/stored_frames.h"

#include <xxhash.h>

#include <string>
#include <utility>

#include "base/error.h"
#include "store/jpegxl/packed_frame.h"
#include "store/rotten_frame.h"

namespace raystage::store {

StoredFrames::StoredFrames(std::filesystem::path archive)
    : path_(std::move(archive)), file_(path_) {}

FrameBytes StoredFrames::read(const FrameRecord& record) const {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input("the frame at byte " + std::to_string(record.offset) + " " + what,
                            path_.string(),
                            "Run `raystage verify` on the take, then `raystage repair`");
  };
  if (record.size > kMaxFrameBytes) throw refuse("has more than 256 MiB");
  auto bytes = std::make_shared<std::vector<std::byte>>(record.size);
  if (file_.read_at(record.offset, *bytes) != bytes->size()) throw refuse("cannot be read");
  if (record.xxh3 != 0 && XXH3_64bits(bytes->data(), bytes->size()) != record.xxh3) {
    throw refuse(std::string(kRottenFrameText));
  }
  return FrameBytes(std::shared_ptr<const std::vector<std::byte>>(std::move(bytes)));
}

}  // namespace raystage::store
