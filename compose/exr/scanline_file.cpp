// SPDX-License-Identifier: Apache-2.0
// Writes EXR files of scan lines: magic number, version, headers, tables of chunk offsets, chunks
// (OpenEXR file layout, "Predefined structure"). Headers are serialised by OpenEXR. Cost: O(pixels)
// conversions and libdeflate; memory: the compressed chunks twice.
#include "compose/exr/scanline_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfVersion.h>
#include <libdeflate.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>

#include "base/parallel.h"
#include "compose/exr/chunk_kernels.h"
#include "compose/exr/memory_stream.h"

namespace raystage::compose {
namespace {

static_assert(std::endian::native == std::endian::little, "EXR files are little-endian");

/// Level 1 compresses predicted bytes nearly as well as zlib's level 4 (docs/benchmarks.md).
constexpr int kLevel = 1;

using Bytes = std::vector<std::uint8_t>;

struct Deleter {
  void operator()(libdeflate_compressor* compressor) const {
    libdeflate_free_compressor(compressor);
  }
};

/// Compresses the chunks of one thread.
class ChunkCompressor {
 public:
  ChunkCompressor() : compressor_(libdeflate_alloc_compressor(kLevel)) {
    if (!compressor_) throw std::bad_alloc();
  }

  /// Returns the bytes of a chunk as stored: as they are if compression does not make them fewer.
  Bytes compress(const Bytes& raw) {
    sorted_.resize(raw.size());
    predicted_.resize(raw.size());
    predict_chunk(raw, sorted_, predicted_);
    // Fewer bytes than raw: readers tell compressed chunks by their size.
    Bytes& packed = sorted_;
    const std::size_t size =
        raw.empty() ? 0
                    : libdeflate_zlib_compress(compressor_.get(), predicted_.data(),
                                               predicted_.size(), packed.data(), raw.size() - 1);
    if (size == 0) return raw;
    return {packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size)};
  }

 private:
  std::unique_ptr<libdeflate_compressor, Deleter> compressor_;
  Bytes sorted_, predicted_;
};

/// A part with its channels in the order of the file.
struct PartLayout {
  Imf::Header header;
  std::vector<ScanlineChannel> channels;
  std::size_t width = 0, bytes_per_line = 0;
  int first_line = 0, lines = 0, lines_per_chunk = 1;
  bool is_compressed = false;

  int chunks() const { return (lines + lines_per_chunk - 1) / lines_per_chunk; }
};

PartLayout layout_of(const ScanlinePart& part, bool is_multi_part) {
  PartLayout layout{part.header, part.channels};
  std::ranges::sort(layout.channels, {}, &ScanlineChannel::name);
  const Imath::Box2i& window = layout.header.dataWindow();
  layout.width = static_cast<std::size_t>(window.max.x) - window.min.x + 1;
  layout.first_line = window.min.y;
  layout.lines = window.max.y - window.min.y + 1;
  for (const ScanlineChannel& channel : layout.channels) {
    layout.header.channels().insert(channel.name,
                                    Imf::Channel(channel.is_half ? Imf::HALF : Imf::FLOAT));
    layout.bytes_per_line += layout.width * (channel.is_half ? 2 : 4);
  }
  const Imf::Compression compression = layout.header.compression();
  layout.is_compressed = compression != Imf::NO_COMPRESSION;
  if (compression == Imf::ZIP_COMPRESSION) layout.lines_per_chunk = 16;
  if (is_multi_part) {
    layout.header.setType(Imf::SCANLINEIMAGE);
    layout.header.setChunkCount(layout.chunks());
  }
  layout.header.sanityCheck(false, is_multi_part);
  return layout;
}

/// Returns the uncompressed bytes of a chunk: for each line, the values of each channel.
void read_chunk(const PartLayout& part, int first, int count, Bytes& raw) {
  raw.resize(part.bytes_per_line * static_cast<std::size_t>(count));
  std::uint8_t* to = raw.data();
  for (int line = first; line < first + count; ++line) {
    for (const ScanlineChannel& channel : part.channels) {
      const float* from =
          channel.first + static_cast<std::size_t>(line) * part.width * channel.stride;
      if (channel.is_half) {
        convert_to_halves(from, channel.stride, part.width, to);
        to += 2 * part.width;
      } else {
        copy_without_nan(from, channel.stride, part.width, channel.nan_replacement, to);
        to += 4 * part.width;
      }
    }
  }
}

std::vector<Bytes> chunks_of(const PartLayout& part) {
  std::vector<Bytes> chunks(static_cast<std::size_t>(part.chunks()));
  parallel_for(tbb::blocked_range<int>(0, part.chunks()), [&](const tbb::blocked_range<int>& some) {
    ChunkCompressor compressor;
    Bytes raw;
    for (int i = some.begin(); i < some.end(); ++i) {
      const int first = i * part.lines_per_chunk;
      read_chunk(part, first, std::min(part.lines_per_chunk, part.lines - first), raw);
      chunks[static_cast<std::size_t>(i)] = part.is_compressed ? compressor.compress(raw) : raw;
    }
  });
  return chunks;
}

/// Returns whether a name is longer than files of version 2 without a flag allow.
bool has_long_names(const Imf::Header& header) {
  constexpr std::size_t kMax = 31;
  for (auto i = header.begin(); i != header.end(); ++i) {
    if (std::strlen(i.name()) > kMax || std::strlen(i.attribute().typeName()) > kMax) return true;
  }
  for (auto i = header.channels().begin(); i != header.channels().end(); ++i) {
    if (std::strlen(i.name()) > kMax) return true;
  }
  return false;
}

void put(std::vector<std::byte>& file, std::span<const std::byte> bytes) {
  file.insert(file.end(), bytes.begin(), bytes.end());
}

template <class Integer>
void put(std::vector<std::byte>& file, Integer value) {
  put(file, std::as_bytes(std::span(&value, 1)));
}

}  // namespace

bool is_scanline_file_compression(Imf::Compression compression) {
  return compression == Imf::NO_COMPRESSION || compression == Imf::ZIPS_COMPRESSION ||
         compression == Imf::ZIP_COMPRESSION;
}

std::vector<std::byte> write_scanline_file(std::span<const ScanlinePart> parts) {
  const bool is_multi_part = parts.size() > 1;
  std::vector<PartLayout> layouts;
  std::vector<std::vector<Bytes>> chunks;
  std::size_t tables = 0, total = 0;
  int version = Imf::EXR_VERSION | (is_multi_part ? Imf::MULTI_PART_FILE_FLAG : 0);
  const std::size_t chunk_header = is_multi_part ? 12 : 8;
  for (const ScanlinePart& part : parts) {
    const PartLayout& layout = layouts.emplace_back(layout_of(part, is_multi_part));
    if (has_long_names(layout.header)) version |= Imf::LONG_NAMES_FLAG;
    chunks.push_back(chunks_of(layout));
    for (const Bytes& chunk : chunks.back()) total += chunk.size() + chunk_header + 8;
    tables += 8 * chunks.back().size();
  }
  MemoryStream headers;
  for (const PartLayout& layout : layouts) layout.header.writeTo(headers);
  const std::vector<std::byte> header_bytes = headers.take();
  std::vector<std::byte> file;
  file.reserve(8 + header_bytes.size() + 1 + total);  // the file may wait for the disk: no more
  put(file, static_cast<std::int32_t>(Imf::MAGIC));
  put(file, static_cast<std::int32_t>(version));
  put(file, std::span(header_bytes));
  if (is_multi_part) put(file, std::uint8_t{0});
  std::uint64_t at = file.size() + tables;
  for (const auto& of_part : chunks) {
    for (const Bytes& chunk : of_part) {
      put(file, at);
      at += chunk.size() + chunk_header;
    }
  }
  for (std::size_t p = 0; p < chunks.size(); ++p) {
    for (std::size_t i = 0; i < chunks[p].size(); ++i) {
      Bytes& chunk = chunks[p][i];
      if (is_multi_part) put(file, static_cast<std::int32_t>(p));
      put(file, static_cast<std::int32_t>(layouts[p].first_line +
                                          static_cast<int>(i) * layouts[p].lines_per_chunk));
      put(file, static_cast<std::int32_t>(chunk.size()));
      put(file, std::as_bytes(std::span(chunk)));
      chunk = Bytes();  // frees its memory
    }
  }
  return file;
}

}  // namespace raystage::compose
