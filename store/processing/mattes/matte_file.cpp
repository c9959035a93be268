// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/matte_file.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>

#include "base/error.h"
#include "sandbox/byte_encoding.h"

namespace raystage::store {
namespace {

sandbox::DecoderOptions matte_decoder_options() {
  constexpr std::size_t kMaxPixels = std::size_t{1} << 28;
  sandbox::DecoderOptions options;
  options.program = "raystage-decode-matte";
  options.kind = "matte";
  options.advice = "Write an 8-bit grey PNG (see docs/formats/mattes.md)";
  // libpng converts whole pictures of 4 bytes per pixel.
  options.memory_bytes = (std::size_t{64} << 20) + 6 * kMaxPixels;
  options.result_bytes = kMaxPixels + 4096;
  options.time = std::chrono::seconds(30);
  return options;
}

}  // namespace

ContainedPath matte_file(const Take& take, int camera, int frame) {
  return take.file(std::filesystem::path("mattes") / take.document().cameras[camera].id /
                   fmt::format("{:06}.png", frame));
}

MatteReader::MatteReader() : decoders_(matte_decoder_options()) {}

std::vector<std::uint8_t> MatteReader::read(const ContainedPath& file, int width,
                                            int height) const {
  if (!open_contained_to_read(file).open()) throw contained_open_error(file, errno);
  const std::string name = file.path().string();
  const auto matte_error = [&](const std::string& what) {
    return Error::bad_input(what, name,
                            fmt::format("Write an 8-bit grey PNG of {}x{} pixels (see "
                                        "docs/formats/mattes.md)",
                                        width, height));
  };
  std::vector<std::byte> result;
  try {
    result =
        decoders_.decode(std::as_bytes(std::span(name)), file.path(), sandbox::only_file(file));
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kBadInput) throw;
    throw matte_error(error.what_happened());
  }
  try {
    sandbox::ByteReader reader(result);
    const int its_width = reader.read<int>(), its_height = reader.read<int>();
    if (its_width != width || its_height != height) {
      throw matte_error(fmt::format("the matte has {}x{} pixels, its camera {}x{}", its_width,
                                    its_height, width, height));
    }
    const std::span<const std::byte> codes = reader.read_rest();
    sandbox::ByteReader::require(codes.size() == static_cast<std::size_t>(width) *
                                                     static_cast<std::size_t>(height));
    std::vector<std::uint8_t> matte(codes.size());
    std::memcpy(matte.data(), codes.data(), codes.size());
    return matte;
  } catch (const std::runtime_error& error) {
    throw matte_error(std::string("the matte cannot be read: ") + error.what());
  }
}

}  // namespace raystage::store
