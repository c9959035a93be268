// SPDX-License-Identifier: Apache-2.0
// Reads any bytes as a Matroska archive without a journal: gives a valid table or an Error.
#include <cstdint>

#include "archive_invariants.h"
#include "base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  try {
    raystage::check_index(raystage::store::index_archive(bytes, std::nullopt, "archive", "journal"),
                          bytes);
  } catch (const raystage::Error&) {
  }
  return 0;
}
