// SPDX-License-Identifier: Apache-2.0
// Measures full and partial decoding against turbojpeg's tjDecompress2 on the same frames.
// Frames: the files named by RAYSTAGE_BENCH_JPEGS (separated by ':'), otherwise a synthetic
// picture.
#include <benchmark/benchmark.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "store/jpeg/convert_to_linear.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/layout.h"
#include "store/jpeg/scan_decoder.h"

namespace raystage {
namespace {

using Bytes = std::vector<std::byte>;

// Returns texture of all frequencies with amplitudes that decrease with frequency, as photographs.
store::RgbImage made_picture(int width, int height) {
  store::RgbImage image{width, height, std::vector<std::uint8_t>()};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        double value = 128;
        for (int octave = 1; octave <= 6; ++octave) {
          const double scale = std::pow(2.0, octave) / 200;
          value += 60 / std::pow(1.7, octave) *
                   std::sin(x * scale * (1 + 0.3 * octave) + c + 3 * std::sin(y * scale + octave));
        }
        image.values.push_back(static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0)));
      }
    }
  }
  return image;
}

std::vector<Bytes> plain_frames() {
  std::vector<Bytes> frames;
  const char* names = std::getenv("RAYSTAGE_BENCH_JPEGS");
  std::istringstream list(names != nullptr ? names : "");
  for (std::string name; std::getline(list, name, ':');) {
    const std::string text = read_file(name);
    const auto bytes = std::as_bytes(std::span(text));
    frames.emplace_back(bytes.begin(), bytes.end());
  }
  if (frames.empty())
    frames.push_back(store::encode_jpeg(made_picture(960, 640),
                                        {85, store::JpegEncodeOptions::Chroma::k420, 0}));
  return frames;
}

std::vector<Bytes> marked_frames(int interval) {
  std::vector<Bytes> frames;
  for (const Bytes& frame : plain_frames())
    frames.push_back(store::add_restart_markers(frame, interval, "bench"));
  return frames;
}

store::LinearTable table() {
  store::LinearTable linear;
  for (auto& channel : linear.code)
    for (int code = 0; code < 256; ++code)
      channel[code] = static_cast<std::uint16_t>(65535 * std::pow(code / 255.0, 2.2) + 0.5);
  return linear;
}

// Returns a rectangle of 1/`side` of the width and height in the middle.
store::McuMask middle(const store::JpegLayout& layout, int side) {
  store::McuMask wanted(static_cast<std::size_t>(layout.mcu_count()), 0);
  const int columns = std::max(1, layout.mcus_per_row / side);
  const int rows = std::max(1, layout.mcu_rows / side);
  const int left = (layout.mcus_per_row - columns) / 2, top = (layout.mcu_rows - rows) / 2;
  for (int row = top; row < top + rows; ++row)
    for (int column = left; column < left + columns; ++column)
      wanted[row * layout.mcus_per_row + column] = 1;
  return wanted;
}

void set_rate(benchmark::State& state, double pixels, const char* name) {
  state.counters[name] = benchmark::Counter(pixels / 1e6, benchmark::Counter::kIsRate);
}

void BM_TurboJpegFull(benchmark::State& state) {
  const auto frames = plain_frames();
  const tjhandle handle = tjInitDecompress();
  std::vector<unsigned char> rgb;
  double pixels = 0;
  std::size_t next = 0;
  for (auto _ : state) {
    const Bytes& frame = frames[next++ % frames.size()];
    const auto* bytes = reinterpret_cast<const unsigned char*>(frame.data());
    int width = 0, height = 0, subsampling = 0, color = 0;
    tjDecompressHeader3(handle, bytes, frame.size(), &width, &height, &subsampling, &color);
    rgb.resize(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    tjDecompress2(handle, bytes, frame.size(), rgb.data(), width, 0, height, TJPF_RGB,
                  TJFLAG_ACCURATEDCT);
    benchmark::DoNotOptimize(rgb.data());
    pixels += double(width) * height;
  }
  tjDestroy(handle);
  set_rate(state, pixels, "MP/s");
}
BENCHMARK(BM_TurboJpegFull);

// Argument: 1 with restart markers.
void BM_TurboJpegPlanes(benchmark::State& state) {
  const auto frames = state.range(0) != 0 ? marked_frames(-1) : plain_frames();
  const tjhandle handle = tjInitDecompress();
  std::vector<unsigned char> yuv;
  double pixels = 0;
  std::size_t next = 0;
  for (auto _ : state) {
    const Bytes& frame = frames[next++ % frames.size()];
    const auto* bytes = reinterpret_cast<const unsigned char*>(frame.data());
    int width = 0, height = 0, subsampling = 0, color = 0;
    tjDecompressHeader3(handle, bytes, frame.size(), &width, &height, &subsampling, &color);
    yuv.resize(tjBufSizeYUV2(width, 4, height, subsampling));
    tjDecompressToYUV2(handle, bytes, frame.size(), yuv.data(), width, 4, height,
                       TJFLAG_ACCURATEDCT);
    benchmark::DoNotOptimize(yuv.data());
    pixels += double(width) * height;
  }
  tjDestroy(handle);
  set_rate(state, pixels, "MP/s");
}
BENCHMARK(BM_TurboJpegPlanes)->Arg(0)->Arg(1);

// Entropy decoding and inverse DCT of whole frames. Argument: 1 with restart markers.
void BM_OwnPlanes(benchmark::State& state) {
  const auto frames = state.range(0) != 0 ? marked_frames(-1) : plain_frames();
  store::ScanDecoder scan;
  double pixels = 0;
  std::size_t next = 0;
  for (auto _ : state) {
    const Bytes& frame = frames[next++ % frames.size()];
    const store::JpegLayout layout = store::parse_jpeg_layout(frame, "bench");
    const store::McuMask wanted(static_cast<std::size_t>(layout.mcu_count()), 1);
    scan.decode(frame, layout, wanted, "bench");
    benchmark::DoNotOptimize(scan.plane(0).samples.data());
    pixels += double(layout.width) * layout.height;
  }
  set_rate(state, pixels, "MP/s");
}
BENCHMARK(BM_OwnPlanes)->Arg(0)->Arg(1);

void BM_Layout(benchmark::State& state) {
  const auto frames = marked_frames(-1);
  std::size_t next = 0;
  for (auto _ : state) {
    const store::JpegLayout layout =
        store::parse_jpeg_layout(frames[next++ % frames.size()], "bench");
    benchmark::DoNotOptimize(layout.segment_offset.data());
  }
}
BENCHMARK(BM_Layout);

void BM_Convert(benchmark::State& state) {
  const Bytes frame = plain_frames().front();
  const store::JpegLayout layout = store::parse_jpeg_layout(frame, "bench");
  const store::McuMask wanted = middle(layout, static_cast<int>(state.range(0)));
  store::ScanDecoder scan;
  scan.decode(frame, layout, wanted, "bench");
  std::vector<std::uint16_t> rgba(4 * static_cast<std::size_t>(layout.width * layout.height));
  const store::LinearTable linear = table();
  double pixels = 0;
  for (auto _ : state) {
    store::convert_to_linear(scan, layout, wanted, linear, rgba);
    pixels += static_cast<double>(std::count(wanted.begin(), wanted.end(), 1)) * layout.mcu_width *
              layout.mcu_height;
  }
  set_rate(state, pixels, "MP/s");
}
BENCHMARK(BM_Convert)->Arg(1)->Arg(4);

// From bytes to linear pixels. First argument: 1/side of the picture; second: restart markers.
void BM_Region(benchmark::State& state) {
  const auto frames = state.range(1) != 0 ? marked_frames(-1) : plain_frames();
  store::JpegDecoder decoder;
  const store::LinearTable linear = table();
  std::vector<std::uint16_t> rgba;
  double decoded = 0, needed = 0;
  std::size_t next = 0;
  for (auto _ : state) {
    const Bytes& frame = frames[next++ % frames.size()];
    const store::JpegLayout layout = store::parse_jpeg_layout(frame, "bench");
    const store::McuMask wanted = middle(layout, static_cast<int>(state.range(0)));
    rgba.resize(4 * static_cast<std::size_t>(layout.width * layout.height));
    decoded +=
        static_cast<double>(decoder.decode_region(frame, layout, wanted, linear, rgba, "bench"));
    needed += static_cast<double>(std::count(wanted.begin(), wanted.end(), 1)) * layout.mcu_width *
              layout.mcu_height;
  }
  set_rate(state, needed, "wanted MP/s");
  state.counters["decoded/wanted"] = decoded / needed;
}
BENCHMARK(BM_Region)->ArgsProduct({{1, 2, 4, 8}, {0, 1}});

}  // namespace
}  // namespace raystage

BENCHMARK_MAIN();
