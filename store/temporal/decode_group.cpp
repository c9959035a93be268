// SPDX-License-Identifier: Apache-2.0
// raystage-decode-group, in lib/raystage: decodes groups of temporal frames for its parent process,
// see sandbox/.
#include <cstdint>
#include <stdexcept>

#include "sandbox/byte_encoding.h"
#include "sandbox/decoder_main.h"
#include "store/temporal/group_decoding.h"
#include "store/temporal/group_requests.h"

namespace {

using namespace raystage;

std::vector<std::byte> answer(std::span<const std::byte> request) {
  sandbox::ByteReader reader(request);
  store::GroupRequest group;
  reader.read(group.codec);
  reader.read(group.width);
  reader.read(group.height);
  reader.read(group.frames);
  if (group.frames > store::kMaxGroupFrames) throw std::runtime_error("it has too many frames");
  std::vector<std::vector<std::byte>> frames(group.frames);
  for (std::vector<std::byte>& frame : frames) reader.read_plain(frame);
  sandbox::ByteWriter result;
  for (const std::vector<std::byte>& jpeg : store::decode_group(
           static_cast<store::VideoCodec>(group.codec), group.width, group.height, frames)) {
    result.write_plain(jpeg);
  }
  return result.take();
}

}  // namespace

int main(int argc, char** argv) { return sandbox::decoder_main(argc, argv, answer); }
