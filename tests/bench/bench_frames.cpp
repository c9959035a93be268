// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/bench_frames.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>

#include "base/atomic_file.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/raw_encoder.h"
#include "testing/store/test_images.h"

namespace raystage {
namespace {

constexpr int kPictures = 16;

/// Returns the middle of a picture, every `step`-th pixel.
store::RgbImage cut(const store::RgbImage& image, int width, int height, int step) {
  store::RgbImage out{width, height, std::vector<std::uint8_t>()};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto at = static_cast<std::size_t>(
          3 * ((y * step + (image.height - height * step) / 2) * image.width + x * step +
               (image.width - width * step) / 2));
      for (std::size_t c = 0; c < 3; ++c) out.values.push_back(image.values[at + c]);
    }
  }
  return out;
}

}  // namespace

std::vector<store::RgbImage> load_bench_images(int width, int height, int step) {
  std::vector<store::RgbImage> result;
  if (const char* folder = std::getenv("RAYSTAGE_BENCH_PICTURES")) {
    std::vector<std::filesystem::path> files;
    for (const auto& file : std::filesystem::directory_iterator(folder)) {
      if (file.path().extension() == ".jpg") files.push_back(file.path());
    }
    std::ranges::sort(files);
    for (const auto& file : files) {
      const std::string bytes = read_file(file);
      const store::RgbImage image =
          store::JpegDecoder().decode(std::as_bytes(std::span(bytes)), file.string());
      if (image.width >= width * step && image.height >= height * step) {
        result.push_back(cut(image, width, height, step));
      }
      if (result.size() == kPictures) return result;
    }
  }
  while (result.size() < kPictures) {
    result.push_back(testing::make(testing::Kind::kMixed, width, height,
                                   static_cast<std::uint32_t>(result.size())));
  }
  return result;
}

namespace {

/// Returns full-range 4:2:0 planes (JFIF), chroma averaged over 2x2 pixels.
store::RawImage yuv420(const store::RgbImage& rgb) {
  const int width = rgb.width, height = rgb.height;
  auto bytes =
      std::make_shared<std::vector<std::byte>>(static_cast<std::size_t>(width * height * 3 / 2));
  const auto store = [&](std::size_t at, double value) {
    (*bytes)[at] = static_cast<std::byte>(std::lround(std::clamp(value, 0.0, 255.0)));
  };
  const auto channel = [&](int x, int y, int c) -> double {
    return rgb.values[3 * (y * width + x) + c];
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      store(static_cast<std::size_t>(y * width + x),
            0.299 * channel(x, y, 0) + 0.587 * channel(x, y, 1) + 0.114 * channel(x, y, 2));
    }
  }
  const auto chroma_size = static_cast<std::size_t>(width * height / 4);
  for (int y = 0; y < height; y += 2) {
    for (int x = 0; x < width; x += 2) {
      std::array<double, 3> mean{};
      for (int c = 0; c < 3; ++c) {
        mean[c] = (channel(x, y, c) + channel(x + 1, y, c) + channel(x, y + 1, c) +
                   channel(x + 1, y + 1, c)) /
                  4;
      }
      const auto at = static_cast<std::size_t>(width * height + y / 2 * (width / 2) + x / 2);
      store(at, 128 - 0.168736 * mean[0] - 0.331264 * mean[1] + 0.5 * mean[2]);
      store(at + chroma_size, 128 + 0.5 * mean[0] - 0.418688 * mean[1] - 0.081312 * mean[2]);
    }
  }
  store::RawImage image;
  image.format = store::PixelFormat::kYuv420;
  image.width = width;
  image.height = height;
  const auto w = static_cast<std::size_t>(width);
  const auto luma = w * static_cast<std::size_t>(height);
  image.planes = {store::RawImage::Plane{bytes->data(), w},
                  {bytes->data() + luma, w / 2},
                  {bytes->data() + luma + chroma_size, w / 2}};
  image.owner = bytes;
  return image;
}

}  // namespace

std::vector<ingest::SourceFrame> raw_frames(const std::vector<store::RgbImage>& images) {
  std::vector<ingest::SourceFrame> frames;
  for (const store::RgbImage& image : images) {
    frames.emplace_back();
    frames.back().raw = yuv420(image);
  }
  return frames;
}

std::vector<ingest::SourceFrame> jpeg_frames(const std::vector<ingest::SourceFrame>& raw,
                                             int quality) {
  store::RawJpegEncoder encoder({quality, store::JpegEncodeOptions::Chroma::k420, -1});
  std::vector<ingest::SourceFrame> frames;
  for (const ingest::SourceFrame& frame : raw) {
    frames.emplace_back();
    encoder.encode(frame.raw, frames.back().jpeg);
  }
  return frames;
}

double psnr(const std::vector<store::RgbImage>& a, const std::vector<store::RgbImage>& b) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t p = 0; p < a[i].values.size(); ++p) {
      sum += std::pow(a[i].values[p] - b[i].values[p], 2);
    }
    count += static_cast<double>(a[i].values.size());
  }
  return 10 * std::log10(255 * 255 / (sum / count));
}

std::vector<store::RgbImage> decoded(const std::vector<ingest::SourceFrame>& raw, int quality) {
  store::RawJpegEncoder encoder({quality, store::JpegEncodeOptions::Chroma::k420, 0});
  std::vector<store::RgbImage> images;
  std::vector<std::byte> bytes;
  for (const ingest::SourceFrame& frame : raw) {
    encoder.encode(frame.raw, bytes);
    images.push_back(store::JpegDecoder().decode(bytes, "bench"));
  }
  return images;
}

}  // namespace raystage
