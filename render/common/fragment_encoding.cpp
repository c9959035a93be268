// SPDX-License-Identifier: Apache-2.0
// Encodes fragments as bytes and decodes them. A message is a header, the list of rectangles, and
// one block of samples that depends on the encoding (docs/formats/fragments.md). Ranks of one job
// run the same program on machines of one byte order. The reader still checks every size, because a
// message may be damaged.
#include "render/common/fragment_encoding.h"

#include <Imath/half.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "base/error.h"
#include "base/options.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/layout.h"

namespace raystage::render {
namespace {

constexpr std::uint32_t kMagic = 0x31465352;  // "RSF1"
constexpr int kMaxPixels = 1 << 30;

struct Header {
  std::uint32_t magic = kMagic;
  FragmentTag tag;
  std::int32_t width = 0, height = 0;
  std::uint32_t encoding = 0;
  std::uint32_t count = 0;  ///< rectangles
};
static_assert(sizeof(Header) == 32);
static_assert(sizeof(FragmentArea) == 16);

template <class T>
void append(const T* values, std::size_t count, std::vector<std::byte>& message) {
  const auto* bytes = reinterpret_cast<const std::byte*>(values);  // trivially copyable
  message.insert(message.end(), bytes, bytes + count * sizeof(T));
}

Error damaged(const std::string& what) {
  return Error::bad_input("a message with fragments is damaged: " + what, "fragments",
                          "Check the network between the ranks, then render again");
}

/// Reads a message from its front.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> message) : rest_(message) {}
  std::span<const std::byte> bytes(std::size_t count) {
    if (count > rest_.size()) throw damaged("it is truncated");
    const auto taken = rest_.first(count);
    rest_ = rest_.subspan(count);
    return taken;
  }
  template <class T>
  T value() {
    T result;
    std::memcpy(&result, bytes(sizeof(T)).data(), sizeof(T));
    return result;
  }
  bool is_empty() const { return rest_.empty(); }

 private:
  std::span<const std::byte> rest_;
};

/// Calls body(pointer to the row's first value, pixels) for each row of an area.
template <class Value, class Body>
void for_each_row(std::span<Value> sums, int width, const FragmentArea& area, const Body& body) {
  for (int y = area.y; y < area.y + area.height; ++y) {
    const std::size_t at = (static_cast<std::size_t>(y) * width + area.x) * 4;
    body(sums.data() + at, static_cast<std::size_t>(area.width));
  }
}

void append_floats(std::span<const float> sums, int width, const FragmentArea& area,
                   std::vector<std::byte>& message) {
  for_each_row(sums, width, area,
               [&](const float* row, std::size_t n) { append(row, 4 * n, message); });
}

void add_floats(Reader& reader, const FragmentArea& area, int width, std::span<float> sums) {
  for_each_row(sums, width, area, [&](float* row, std::size_t n) {
    const auto bytes = reader.bytes(4 * n * sizeof(float));
    for (std::size_t i = 0; i < 4 * n; ++i) {
      float value = 0;
      std::memcpy(&value, bytes.data() + i * sizeof(float), sizeof(float));
      row[i] += value;
    }
  });
}

constexpr float kFullScale = 65535;

void append_halves(std::span<const float> sums, int width, const FragmentArea& area,
                   std::vector<std::byte>& message) {
  for_each_row(sums, width, area, [&](const float* row, std::size_t n) {
    for (std::size_t i = 0; i < 4 * n; ++i) {
      const std::uint16_t bits = Imath::half(row[i] / kFullScale).bits();
      append(&bits, 1, message);
    }
  });
}

void add_halves(Reader& reader, const FragmentArea& area, int width, std::span<float> sums) {
  for_each_row(sums, width, area, [&](float* row, std::size_t n) {
    for (std::size_t i = 0; i < 4 * n; ++i) {
      Imath::half value;
      value.setBits(reader.value<std::uint16_t>());
      row[i] += static_cast<float>(value) * kFullScale;
    }
  });
}

/// Returns the bytes of a sample, if the encoding fixes them.
std::size_t bytes_of_sample(FragmentEncoding encoding) {
  switch (encoding) {
    case FragmentEncoding::kFloat:
      return 4 * sizeof(float);
    case FragmentEncoding::kHalf:
      return 4 * sizeof(std::uint16_t);
    case FragmentEncoding::kJpeg:
      break;
  }
  return 0;
}

void append_block(std::span<const std::byte> block, std::vector<std::byte>& message) {
  const auto size = static_cast<std::uint32_t>(block.size());
  append(&size, 1, message);
  append(block.data(), block.size(), message);
}

void append_jpeg(std::span<const float> sums, int width, const FragmentArea& area, int quality,
                 std::vector<std::byte>& message) {
  store::RgbImage image{area.width, area.height, std::vector<std::uint8_t>()};
  image.values.reserve(area.pixels() * 3);
  for_each_row(sums, width, area, [&](const float* row, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float code = std::clamp(row[4 * i + c] / 257.0F, 0.0F, 255.0F);
        image.values.push_back(static_cast<std::uint8_t>(code + 0.5F));
      }
    }
  });
  append_block(
      store::encode_jpeg(image, {quality, store::JpegEncodeOptions::Chroma::k420, 0, true}),
      message);
}

void add_jpeg(Reader& reader, const FragmentArea& area, int width, std::span<float> sums) {
  const auto size = reader.value<std::uint32_t>();
  const auto jpeg = reader.bytes(size);
  const store::JpegLayout layout = store::parse_jpeg_layout(jpeg, "fragments");
  if (layout.width != area.width || layout.height != area.height) {
    throw damaged("an image and its rectangle differ in size");
  }
  store::JpegDecoder decoder;
  const store::RgbImage image = decoder.decode(jpeg, "fragments");
  const std::uint8_t* pixel = image.values.data();
  for_each_row(sums, width, area, [&](float* row, std::size_t n) {
    for (std::size_t i = 0; i < n; ++i, pixel += 3) {
      for (std::size_t c = 0; c < 3; ++c) row[4 * i + c] += 257.0F * static_cast<float>(pixel[c]);
    }
  });
}

FragmentArea box_around(std::span<const FragmentArea> areas) {
  FragmentArea box = areas.front();
  for (const FragmentArea& area : areas) {
    const int right = std::max(box.x + box.width, area.x + area.width);
    const int bottom = std::max(box.y + box.height, area.y + area.height);
    box.x = std::min(box.x, area.x);
    box.y = std::min(box.y, area.y);
    box.width = right - box.x;
    box.height = bottom - box.y;
  }
  return box;
}

void check(const FragmentArea& area, int width, int height) {
  const bool is_inside = area.x >= 0 && area.y >= 0 && area.width > 0 && area.height > 0 &&
                         area.width <= width && area.height <= height &&
                         area.x <= width - area.width && area.y <= height - area.height;
  if (!is_inside) throw damaged("a rectangle lies outside of the view");
}

}  // namespace

bool FragmentEncodingOptions::is_valid(std::string* reason) const {
  return is_within("JPEG quality of fragments", jpeg_quality, 1, 100, reason);
}

std::vector<std::byte> encode_fragments(const FragmentTag& tag, std::span<const float> sums,
                                        int width, int height,
                                        const FragmentEncodingOptions& options,
                                        FragmentCounts& counts) {
  require_valid(options, "fragments");
  std::vector<FragmentArea> areas = cover_nonzero_pixels(sums, width, height);
  // One JPEG is smaller: each has a header of 600 bytes, and zeros compress well.
  if (options.encoding == FragmentEncoding::kJpeg && areas.size() > 1) areas = {box_around(areas)};
  Header header;
  header.tag = tag;
  header.width = width;
  header.height = height;
  header.encoding = static_cast<std::uint32_t>(options.encoding);
  header.count = static_cast<std::uint32_t>(areas.size());
  std::size_t samples = 0;
  for (const FragmentArea& area : areas) samples += area.pixels();
  std::vector<std::byte> message;
  message.reserve(sizeof(Header) + areas.size() * sizeof(FragmentArea) +
                  samples * bytes_of_sample(options.encoding));
  append(&header, 1, message);
  append(areas.data(), areas.size(), message);
  for (const FragmentArea& area : areas) {
    switch (options.encoding) {
      case FragmentEncoding::kFloat:
        append_floats(sums, width, area, message);
        break;
      case FragmentEncoding::kHalf:
        append_halves(sums, width, area, message);
        break;
      case FragmentEncoding::kJpeg:
        append_jpeg(sums, width, area, options.jpeg_quality, message);
        break;
    }
  }
  counts.samples += static_cast<std::int64_t>(samples);
  counts.fragments += static_cast<std::int64_t>(areas.size());
  counts.bytes += static_cast<std::int64_t>(message.size());
  return message;
}

void add_fragments(std::span<const std::byte> message, const FragmentTag& tag, int width,
                   int height, std::span<float> sums) {
  Reader reader(message);
  const auto header = reader.value<Header>();
  if (header.magic != kMagic) throw damaged("it does not begin with RSF1");
  if (header.tag != tag) throw damaged("it belongs to another view");
  if (header.width != width || header.height != height) {
    throw damaged(
        fmt::format("its view is {}x{}, not {}x{}", header.width, header.height, width, height));
  }
  if (header.count > static_cast<std::uint32_t>(kMaxPixels)) throw damaged("too many rectangles");
  const auto listed = reader.bytes(header.count * sizeof(FragmentArea));
  std::vector<FragmentArea> areas(header.count);
  if (!areas.empty()) std::memcpy(areas.data(), listed.data(), listed.size());
  std::size_t pixels = 0;
  for (const FragmentArea& area : areas) {
    check(area, width, height);
    pixels += area.pixels();
  }
  if (pixels > sums.size() / 4) throw damaged("its rectangles overlap");
  for (const FragmentArea& area : areas) {
    switch (static_cast<FragmentEncoding>(header.encoding)) {
      case FragmentEncoding::kFloat:
        add_floats(reader, area, width, sums);
        break;
      case FragmentEncoding::kHalf:
        add_halves(reader, area, width, sums);
        break;
      case FragmentEncoding::kJpeg:
        add_jpeg(reader, area, width, sums);
        break;
      default:
        throw damaged("its encoding is unknown");
    }
  }
}

}  // namespace raystage::render
