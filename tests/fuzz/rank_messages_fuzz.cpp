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
      round_trip(message, decode_frame_reply);
  }
  return 0;
}
