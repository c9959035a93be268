// SPDX-License-Identifier: Apache-2.0
// Encodes and decodes files of inverse depth maps (docs/formats/depth.md). A depth is a 16-bit
// multiple of a power of two per map, stored as its difference from the depth before in the row and
// compressed by zstd. Input and output: maps in 1/m. Cost: O(pixels); memory of one map.
#include "render/depth/depth_file.h"

#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <new>
#include <string>

#include "base/error.h"
#include "base/little_endian.h"

namespace raystage::render {
namespace {

constexpr std::array<char, 8> kMagic{'R', 'A', 'Y', 'S', 'D', 'E', 'P', 'T'};
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kVersionAt = 8, kMapsAt = 12, kFingerprintAt = 16, kHeaderBytes = 24;
constexpr std::size_t kMapHeaderBytes = 12;
constexpr int kLevel = 3;

/// Returns 0 if unknown, else 1 + the depth in steps.
std::uint16_t code_of(float depth, float step) {
  if (depth < 0) return 0;
  return static_cast<std::uint16_t>(1 + std::lround(std::min(depth / step, kMaxDepthSteps)));
}
float depth_of(std::uint16_t code, float step) {
  return code == 0 ? kUnknownDepth : static_cast<float>(code - 1) * step;
}

/// Returns whether depth_step() can return this value.
bool is_step(float step) {
  int exponent = 0;
  return std::frexp(step, &exponent) == 0.5F && std::isfinite(step * kMaxDepthSteps);
}

std::size_t bytes_of(const InverseDepthMap& map) { return kMapHeaderBytes + 2 * map.values.size(); }

class Compressor {
 public:
  Compressor(std::size_t bytes, const WriteBytes& write)
      : context_(ZSTD_createCCtx()), write_(write), block_(ZSTD_CStreamOutSize()) {
    if (!context_) throw std::bad_alloc();
    ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_compressionLevel, kLevel);
    ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_checksumFlag, 1);
    ZSTD_CCtx_setPledgedSrcSize(context_.get(), bytes);
  }
  void add(std::span<const std::byte> bytes) { run(bytes, ZSTD_e_continue); }
  void end() { run({}, ZSTD_e_end); }

 private:
  struct Deleter {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  };

  void run(std::span<const std::byte> bytes, ZSTD_EndDirective until) {
    ZSTD_inBuffer input{bytes.data(), bytes.size(), 0};
    for (bool done = false; !done;) {
      ZSTD_outBuffer output{block_.data(), block_.size(), 0};
      const std::size_t left = ZSTD_compressStream2(context_.get(), &output, &input, until);
      if (ZSTD_isError(left)) throw std::bad_alloc();  // the only possible error
      if (output.pos > 0) write_(std::span(block_).first(output.pos));
      done = until == ZSTD_e_end ? left == 0 : input.pos == input.size;
    }
  }

  std::unique_ptr<ZSTD_CCtx, Deleter> context_;
  const WriteBytes& write_;
  std::vector<std::byte> block_;
};

class Decompressor {
 public:
  explicit Decompressor(std::span<const std::byte> file)
      : context_(ZSTD_createDCtx()), input_{file.data(), file.size(), 0} {
    if (!context_) throw std::bad_alloc();
    ZSTD_DCtx_setParameter(context_.get(), ZSTD_d_windowLogMax, kMaxWindowLog);
  }
  /// Returns false if the frame is damaged or holds fewer bytes.
  bool take(std::span<std::byte> bytes) {
    ZSTD_outBuffer output{bytes.data(), bytes.size(), 0};
    while (output.pos < output.size) {
      if (!step(output)) return false;
    }
    return true;
  }
  /// Returns whether the frame, and the file with it, ends here with a correct checksum.
  bool ends() {
    std::byte more{};
    ZSTD_outBuffer output{&more, 1, 0};
    while (!is_over_ && step(output)) {
    }
    return is_over_ && output.pos == 0 && input_.pos == input_.size;
  }

 private:
  struct Deleter {
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
  };
  static constexpr int kMaxWindowLog = 21;  // of kLevel

  bool step(ZSTD_outBuffer& output) {
    if (is_over_) return false;
    const std::size_t read = input_.pos, written = output.pos;
    const std::size_t left = ZSTD_decompressStream(context_.get(), &output, &input_);
    is_over_ = left == 0;
    return !ZSTD_isError(left) && (is_over_ || input_.pos > read || output.pos > written);
  }

  std::unique_ptr<ZSTD_DCtx, Deleter> context_;
  ZSTD_inBuffer input_;
  bool is_over_ = false;
};

std::vector<std::byte> payload_of(const InverseDepthMap& map) {
  std::vector<std::byte> payload(bytes_of(map));
  const float step = depth_step(map);
  store_little_endian(payload, 0, static_cast<std::uint32_t>(map.width));
  store_little_endian(payload, 4, static_cast<std::uint32_t>(map.height));
  store_little_endian(payload, 8, std::bit_cast<std::uint32_t>(step));
  std::size_t at = kMapHeaderBytes;
  std::uint16_t before = 0;  // differences along the rows are small, which compresses well
  for (const float depth : map.values) {
    const std::uint16_t code = code_of(depth, step);
    store_little_endian(payload, at, static_cast<std::uint16_t>(code - before));
    before = code;
    at += 2;
  }
  return payload;
}

}  // namespace

float depth_step(const InverseDepthMap& map) {
  const float greatest = map.values.empty() ? 0.0F : *std::ranges::max_element(map.values);
  if (!(greatest > 0)) return 1;
  int exponent = 0;
  const float part = std::frexp(greatest / kMaxDepthSteps, &exponent);
  return std::ldexp(1.0F, part == 0.5F ? exponent - 1 : exponent);
}

void quantise_depths(InverseDepthMap& map) {
  const float step = depth_step(map);
  for (float& depth : map.values) depth = depth_of(code_of(depth, step), step);
}

void encode_depth_maps(std::span<const InverseDepthMap> maps, std::uint64_t fingerprint,
                       const WriteBytes& write) {
  std::size_t bytes = kHeaderBytes;
  for (const InverseDepthMap& map : maps) bytes += bytes_of(map);
  std::array<std::byte, kHeaderBytes> header{};
  std::ranges::copy(std::as_bytes(std::span(kMagic)), header.begin());
  store_little_endian(header, kVersionAt, kVersion);
  store_little_endian(header, kMapsAt, static_cast<std::uint32_t>(maps.size()));
  store_little_endian(header, kFingerprintAt, fingerprint);
  Compressor frame(bytes, write);
  frame.add(header);
  for (const InverseDepthMap& map : maps) frame.add(payload_of(map));
  frame.end();
}

std::vector<InverseDepthMap> decode_depth_maps(std::span<const std::byte> file,
                                               std::uint64_t fingerprint,
                                               std::span<const VirtualCamera> expected,
                                               std::string_view name) {
  const auto refuse = [&](const std::string& what) {
    return Error::bad_input(what, std::string(name),
                            "Delete the file: the depths will be estimated again");
  };
  const auto damaged = [&] { return refuse("the depth file is damaged"); };
  Decompressor frame(file);
  std::array<std::byte, kHeaderBytes> header{};
  if (!frame.take(header) || !std::ranges::equal(std::span(header).first<kMagic.size()>(),
                                                 std::as_bytes(std::span(kMagic)))) {
    throw damaged();
  }
  if (load_little_endian<std::uint32_t>(header, kVersionAt) != kVersion) {
    throw refuse("the depth file has a format version that this program does not read");
  }
  if (load_little_endian<std::uint64_t>(header, kFingerprintAt) != fingerprint ||
      load_little_endian<std::uint32_t>(header, kMapsAt) != expected.size()) {
    throw refuse("the depth file belongs to other frames, another rig or other settings");
  }
  std::vector<InverseDepthMap> maps;
  std::vector<std::byte> codes;
  for (const VirtualCamera& camera : expected) {
    std::array<std::byte, kMapHeaderBytes> of_map{};
    if (!frame.take(of_map)) throw damaged();
    const auto width = load_little_endian<std::uint32_t>(of_map, 0);
    const auto height = load_little_endian<std::uint32_t>(of_map, 4);
    const auto step = std::bit_cast<float>(load_little_endian<std::uint32_t>(of_map, 8));
    if (width == 0 && height == 0) {  // of an absent camera
      maps.emplace_back();
      continue;
    }
    const std::size_t pixels = static_cast<std::size_t>(camera.width) * camera.height;
    codes.resize(2 * pixels);
    if (width != static_cast<std::uint32_t>(camera.width) ||
        height != static_cast<std::uint32_t>(camera.height) || !is_step(step) ||
        !frame.take(codes)) {
      throw damaged();
    }
    InverseDepthMap map(camera.width, camera.height);
    std::uint16_t code = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      code = static_cast<std::uint16_t>(code + load_little_endian<std::uint16_t>(codes, 2 * i));
      map.values[i] = depth_of(code, step);
    }
    maps.push_back(std::move(map));
  }
  if (!frame.ends()) throw damaged();
  return maps;
}

}  // namespace raystage::render
