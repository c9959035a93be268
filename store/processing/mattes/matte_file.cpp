// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/matte_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/error.h"
#include "sandbox/byte_encoding.h"
#include "sandbox/machine_limits.h"

namespace raystage::store {
namespace {

/// `pixels`: of the camera, at most.
sandbox::DecoderOptions matte_decoder_options(std::uint64_t pixels) {
  sandbox::DecoderOptions options;
  options.program = "raystage-decode-matte";
  options.kind = "matte";
  options.advice = "Write an 8-bit grey PNG (see docs/formats/mattes.md)";
  // libpng converts whole pictures of 4 bytes per pixel.
  options.memory_bytes = (std::size_t{64} << 20) + 6 * pixels;
  options.result_bytes = pixels + 4096;
  options.time = std::chrono::seconds(30);
  return sandbox::within_machine(std::move(options));
}

}  // namespace

ContainedPath matte_file(const Take& take, int camera, int frame) {
  return take.file(std::filesystem::path("mattes") / take.document().cameras[camera].id /
                   fmt::format("{:06}.png", frame));
}

const sandbox::DecoderPool& MatteReader::decoders_for(int width, int height) const {
  const std::uint64_t pixels = static_cast<std::uint64_t>(std::max(width, 1)) *
                               static_cast<std::uint64_t>(std::max(height, 1));
  const std::uint64_t most = std::bit_ceil(pixels);
  const std::scoped_lock lock(mutex_);
  const auto known = decoders_.find(most);
  if (known != decoders_.end()) return known->second;
  return decoders_.try_emplace(most, matte_decoder_options(most)).first->second;
}

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
    sandbox::ByteWriter request;
    request.write(width);
    request.write(height);
    request.append(std::as_bytes(std::span(name)));
    result =
        decoders_for(width, height).decode(request.take(), file.path(), sandbox::only_file(file));
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
