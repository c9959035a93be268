// SPDX-License-Identifier: Apache-2.0
// Decodes any bytes as a message between ranks; the first byte selects its type.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "base/error.h"
#include "farm/ranks/messages.h"

namespace {

/// Expects that a decoded message can be encoded and decoded again to the same message.
template <class Decode>
void round_trip(std::span<const std::byte> message, const Decode& decode) {
  raystage::farm::MessageBytes once;
  try {
    once = encode(decode(message));
  } catch (const raystage::Error&) {
    return;
  }
  if (encode(decode(once)) != once) std::abort();
}

/// Expects that a decoder may read each segment of the frame, and divide by the interval.
raystage::farm::FrameReply decode_checked_reply(std::span<const std::byte> message) {
  raystage::farm::FrameReply reply = raystage::farm::decode_frame_reply(message);
  if (!reply.layout) return reply;
  const raystage::store::JpegLayout& layout = *reply.layout;
  const std::vector<std::uint32_t>& offsets = layout.segment_offset;
  const int mcus_per_segment =
      layout.regions_decodable() ? layout.restart_interval : layout.mcu_count();
  if (mcus_per_segment <= 0) std::abort();
  const int last_segment = (layout.mcu_count() - 1) / mcus_per_segment;
  if (last_segment + 1 != layout.segment_count() || layout.scan_offset > offsets[0]) std::abort();
  for (int i = 0; i <= last_segment; ++i) {
    if (offsets[i] + 2 > offsets[i + 1] || offsets[i + 1] > layout.scan_end + 2) std::abort();
  }
  return reply;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace raystage::farm;
  if (size == 0) return 0;
  const auto message = std::as_bytes(std::span(data, size)).subspan(1);
  switch (data[0] % 6) {
    case 0:
      round_trip(message, decode_request);
      break;
    case 1:
      round_trip(message, decode_take_table);
      break;
    case 2:
      round_trip(message, decode_rank_costs);
      break;
    case 3:
      round_trip(message, decode_partial_view);
      break;
    case 4:
      round_trip(message, decode_frame_request);
      break;
    default:
      round_trip(message, decode_checked_reply);
  }
  return 0;
}
