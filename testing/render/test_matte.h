// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace raystage::testing {

/// Writes the matte of a camera's frame (docs/formats/mattes.md): 8-bit grey codes, row by row.
void write_matte(const std::filesystem::path& take, const std::string& camera, int frame, int width,
                 int height, std::span<const std::uint8_t> codes);

}  // namespace raystage::testing
