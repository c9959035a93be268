// SPDX-License-Identifier: Apache-2.0
// How much one node can record, against libjpeg-turbo alone and FFmpeg's recorder, in one run.
// Usage: record_bench [SECONDS [THREADS]]: length of each measurement (default 10), encoder threads
// (default 2). RAYSTAGE_BENCH_PICTURES: a folder of JPEG photographs; without it painted pictures.
#include <fmt/format.h>
#include <sys/resource.h>
#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "ingest/record/record_setup.h"
#include "ingest/sources/memory_source.h"
#include "schemas/atomic_file.h"
#include "schemas/test_folder.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/raw_encoder.h"
#include "store/jpeg/test_images.h"

namespace raystage {
namespace {

using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::byte>;

constexpr int kPictures = 16, kQuality = 90;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// CPU time of this process, or of its children, seconds.
double cpu_seconds(int who) {
  rusage usage{};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// The middle of a picture, every `step`-th pixel.
RgbImage cut(const RgbImage& image, int width, int height, int step) {
  RgbImage out{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto at = static_cast<std::size_t>(
          3 * ((y * step + (image.height - height * step) / 2) * image.width + x * step +
               (image.width - width * step) / 2));
      for (std::size_t c = 0; c < 3; ++c) out.pixels.push_back(image.pixels[at + c]);
    }
  }
  return out;
}

std::vector<RgbImage> pictures(int width, int height, int step) {
  std::vector<RgbImage> result;
  if (const char* folder = std::getenv("RAYSTAGE_BENCH_PICTURES")) {
    std::vector<std::filesystem::path> files;
    for (const auto& file : std::filesystem::directory_iterator(folder)) {
      if (file.path().extension() == ".jpg") files.push_back(file.path());
    }
    std::ranges::sort(files);
    for (const auto& file : files) {
      const std::string bytes = read_file(file);
      const RgbImage image = JpegDecoder().decode(std::as_bytes(std::span(bytes)), file.string());
      if (image.width >= width * step && image.height >= height * step) {
        result.push_back(cut(image, width, height, step));
      }
      if (result.size() == kPictures) return result;
    }
  }
  while (result.size() < kPictures) {
    result.push_back(test_images::make(test_images::Kind::kMixed, width, height,
                                       static_cast<std::uint32_t>(result.size())));
  }
  return result;
}

/// Full-range 4:2:0 (JFIF), chroma averaged over 2x2.
RawImage yuv420(const RgbImage& rgb) {
  const int width = rgb.width, height = rgb.height;
  auto bytes = std::make_shared<Bytes>(static_cast<std::size_t>(width * height * 3 / 2));
  const auto store = [&](std::size_t at, double value) {
    (*bytes)[at] = static_cast<std::byte>(std::lround(std::clamp(value, 0.0, 255.0)));
  };
  const auto channel = [&](int x, int y, int c) -> double {
    return rgb.pixels[static_cast<std::size_t>(3 * (y * width + x) + c)];
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
        mean[static_cast<std::size_t>(c)] = (channel(x, y, c) + channel(x + 1, y, c) +
                                             channel(x, y + 1, c) + channel(x + 1, y + 1, c)) /
                                            4;
      }
      const auto at = static_cast<std::size_t>(width * height + y / 2 * (width / 2) + x / 2);
      store(at, 128 - 0.168736 * mean[0] - 0.331264 * mean[1] + 0.5 * mean[2]);
      store(at + chroma_size, 128 + 0.5 * mean[0] - 0.418688 * mean[1] - 0.081312 * mean[2]);
    }
  }
  RawImage image;
  image.format = PixelFormat::kYuv420;
  image.width = width;
  image.height = height;
  const auto w = static_cast<std::size_t>(width);
  const auto luma = w * static_cast<std::size_t>(height);
  image.planes = {RawImage::Plane{bytes->data(), w},
                  {bytes->data() + luma, w / 2},
                  {bytes->data() + luma + chroma_size, w / 2}};
  image.owner = bytes;
  return image;
}

std::vector<SourceFrame> raw_frames(const std::vector<RgbImage>& images) {
  std::vector<SourceFrame> frames;
  for (const RgbImage& image : images) {
    frames.emplace_back();
    frames.back().raw = yuv420(image);
  }
  return frames;
}

/// libjpeg-turbo alone: frames a second on so many threads.
double turbojpeg_rate(const std::vector<SourceFrame>& frames, int threads, double seconds) {
  std::atomic<std::uint64_t> count = 0;
  const auto start = Clock::now();
  {
    std::vector<std::jthread> workers;
    for (int t = 0; t < threads; ++t) {
      workers.emplace_back([&, t] {
        const tjhandle handle = tjInitCompress();
        unsigned char* out = nullptr;
        unsigned long size = 0;
        for (auto i = static_cast<std::size_t>(t); seconds_since(start) < seconds; ++i) {
          const RawImage& raw = frames[i % frames.size()].raw;
          std::array<const unsigned char*, 3> planes{};
          for (std::size_t p = 0; p < 3; ++p) {
            planes[p] = reinterpret_cast<const unsigned char*>(raw.planes[p].data);
          }
          tjCompressFromYUVPlanes(handle, planes.data(), raw.width, nullptr, raw.height, TJSAMP_420,
                                  &out, &size, kQuality, TJFLAG_ACCURATEDCT);
          ++count;
        }
        tjFree(out);
        tjDestroy(handle);
      });
    }
  }
  return static_cast<double>(count) / seconds_since(start);
}

struct Result {
  double fps = 0, cpu = 0;  ///< stored a second; CPU seconds a second
  std::uint64_t arrived = 0, dropped = 0;
  double megabytes = 0, peak_mb = 0;
  bool audit = false;
  std::string complaint;
};

Result record(const std::vector<SourceFrame>& frames, int cameras, double fps, double seconds,
              RecorderSettings settings) {
  const TestFolder folder;
  RecordConfig config;
  config.name = "bench";
  for (int i = 0; i < cameras; ++i) {
    config.cameras.push_back({fmt::format("c{:02}", i), RecordConfig::SimulatedSource{}});
  }
  auto opened = open_cameras(config, [&](const RecordConfig::Camera&) {
    MemoryScript script;
    script.frames = frames;
    script.fps = fps;
    return memory_source(script);
  });
  RecordingTake take = RecordingTake::create(folder.path() / "take",
                                             take_for(config, opened, "n", host_utc_now(), "bench"),
                                             rig_for(config, {}, opened), "n");
  settings.duration_s = seconds;
  Recorder recorder(settings, std::move(opened), take, "bench");
  const double cpu = cpu_seconds(RUSAGE_SELF);
  const auto start = Clock::now();
  std::uint64_t stored_at_end = 0;
  const auto session = recorder.run({}, [&](const RecorderStatus& status) {
    if (status.seconds > seconds) return;
    stored_at_end = 0;
    for (const auto& camera : status.cameras) stored_at_end += camera.stored;
  });
  const double wall = seconds_since(start);
  Result result;
  result.cpu = (cpu_seconds(RUSAGE_SELF) - cpu) / wall;
  for (const auto& camera : session.cameras) {
    result.arrived += camera.arrived;
    result.fps += static_cast<double>(camera.stored) / wall;
    for (const auto& [reason, count] : camera.dropped) result.dropped += count;
    result.dropped += camera.skipped_by_source;
  }
  for (const auto& file : std::filesystem::directory_iterator(folder.path() / "take" / "archive")) {
    result.megabytes += static_cast<double>(file.file_size()) / 1e6;
  }
  result.peak_mb = static_cast<double>(session.memory_peak_bytes) / 1e6;
  result.audit = session.audit && session.audit->holds;
  if (!result.audit && session.audit) result.complaint = session.audit->complaints.at(0);
  return result;
}

double psnr(const std::vector<RgbImage>& a, const std::vector<RgbImage>& b) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t p = 0; p < a[i].pixels.size(); ++p) {
      sum += std::pow(a[i].pixels[p] - b[i].pixels[p], 2);
    }
    count += static_cast<double>(a[i].pixels.size());
  }
  return 10 * std::log10(255 * 255 / (sum / count));
}

/// What a JPEG of each frame is worth, against the same planes without loss (quality 100).
std::vector<RgbImage> decoded(const std::vector<SourceFrame>& frames, int quality) {
  RawJpegEncoder encoder({quality, JpegEncodeSettings::Chroma::k420, 0});
  std::vector<RgbImage> images;
  Bytes bytes;
  for (const SourceFrame& frame : frames) {
    encoder.encode(frame.raw, bytes);
    images.push_back(JpegDecoder().decode(bytes, "bench"));
  }
  return images;
}

struct Ffmpeg {
  double frames_per_cpu_second = 0, psnr_db = 0;
  int scale = 0;
};

/// FFmpeg's MJPEG recorder on the same pictures, at the quality scale whose PSNR is nearest.
Ffmpeg ffmpeg_recorder(const std::vector<SourceFrame>& frames, double wanted_psnr) {
  const TestFolder folder;
  const std::vector<RgbImage> truth = decoded(frames, 100);
  constexpr int kRepeats = 60;
  const auto raw = folder.path() / "s.yuv";
  const RawImage& first = frames[0].raw;
  const auto write_raw = [&](int repeats) {
    std::ofstream file(raw, std::ios::binary);
    for (int r = 0; r < repeats; ++r) {
      for (const SourceFrame& frame : frames) {
        file.write(reinterpret_cast<const char*>(frame.raw.planes[0].data),
                   static_cast<std::streamsize>(frame.raw.bytes()));
      }
    }
  };
  const auto run = [&](int scale, const std::string& output) {
    const double before = cpu_seconds(RUSAGE_CHILDREN);
    const std::string command = fmt::format(
        "ffmpeg -v error -y -f rawvideo -pix_fmt yuvj420p -s {}x{} -r 30 -i '{}' -c:v "
        "mjpeg -q:v {} '{}/{}'",
        first.width, first.height, raw.string(), scale, folder.path().string(), output);
    if (std::system(command.c_str()) != 0) std::exit(1);
    return cpu_seconds(RUSAGE_CHILDREN) - before;
  };
  Ffmpeg best;
  write_raw(1);
  for (int scale = 2; scale <= 12; ++scale) {
    run(scale, "%02d.jpg");
    std::vector<RgbImage> images;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const std::string bytes = read_file(folder.path() / fmt::format("{:02}.jpg", i + 1));
      images.push_back(JpegDecoder().decode(std::as_bytes(std::span(bytes)), "ffmpeg"));
    }
    const double db = psnr(images, truth);
    if (best.scale == 0 || std::abs(db - wanted_psnr) < std::abs(best.psnr_db - wanted_psnr)) {
      best.psnr_db = db;
      best.scale = scale;
    }
  }
  write_raw(kRepeats);
  const double cpu = run(best.scale, "s.mkv");
  best.frames_per_cpu_second = kRepeats * static_cast<double>(frames.size()) / cpu;
  return best;
}

void print(const std::string& what, const std::string& value) {
  fmt::print("| {} | {} |\n", what, value);
  std::fflush(stdout);
}

void run(double seconds, int threads) {
  RecorderSettings settings;
  settings.threads = threads;
  settings.jpeg = {kQuality, JpegEncodeSettings::Chroma::k420, -1};
  settings.memory_bytes = 500'000'000;
  const auto vga = raw_frames(pictures(640, 480, 1));
  const auto small = raw_frames(pictures(320, 240, 2));
  fmt::print("| measured for {:.0f} s each, {} threads | |\n| --- | --- |\n", seconds, threads);

  const double alone = turbojpeg_rate(vga, threads, seconds);
  const Result full = record(vga, 64, 1.15 * alone / 64, seconds, settings);
  print("64 raw streams 640x480 4:2:0, more than fits",
        fmt::format("{:.0f} frames/s stored, {:.0f} MB/s; libjpeg-turbo alone {:.0f} frames/s: "
                    "{:.1f} %; audit {}{}",
                    full.fps, full.megabytes / seconds, alone, 100 * full.fps / alone,
                    full.audit ? "holds" : "FAILS: ", full.complaint));
  const double wanted = psnr(decoded(vga, kQuality), decoded(vga, 100));
  const Ffmpeg ffmpeg = ffmpeg_recorder(vga, wanted);
  const double ours = full.fps / full.cpu;
  print("frames per CPU second",
        fmt::format(
            "{:.0f} at {:.2f} dB; ffmpeg -c:v mjpeg -q:v {} {:.0f} at {:.2f} dB: {:.2f} times",
            ours, wanted, ffmpeg.scale, ffmpeg.frames_per_cpu_second, ffmpeg.psnr_db,
            ours / ffmpeg.frames_per_cpu_second));
  const Result load = record(vga, 64, 0.9 * full.fps / 64, 6 * seconds, settings);
  print(fmt::format("the same at 90 % of that for {:.0f} s", 6 * seconds),
        fmt::format("{} of {} frames dropped, {:.0f} MB of RAM at most (limit {:.0f})",
                    load.dropped, load.arrived, load.peak_mb, settings.memory_bytes / 1e6));
  const Result thesis = record(small, 64, 15, seconds, settings);
  print("64 raw streams 320x240 at 15 fps",
        fmt::format("{:.1f} % of a core, {} dropped", 100 * thesis.cpu, thesis.dropped));
  settings.hold = true;
  const Result held = record(small, 16, 15, seconds, settings);
  print("16 of them held in memory",
        fmt::format("{:.1f} minutes per GB ({:.1f} KB a frame)",
                    1e9 / (held.peak_mb * 1e6 / seconds) / 60,
                    1e3 * held.megabytes / static_cast<double>(held.arrived)));
  settings.hold = false;
  std::vector<SourceFrame> jpegs;
  // As webcams compress: some 50 KB a frame.
  RawJpegEncoder encoder({70, JpegEncodeSettings::Chroma::k420, -1});
  for (const SourceFrame& frame : vga) {
    jpegs.emplace_back();
    encoder.encode(frame.raw, jpegs.back().jpeg);
  }
  const Result passed = record(jpegs, 64, 30, seconds, settings);
  print("64 JPEG streams 640x480 at 30 fps passed through",
        fmt::format("{:.1f} % of a core, {:.0f} MB/s, {:.0f} KB a frame, {} dropped",
                    100 * passed.cpu, passed.megabytes / seconds,
                    1e3 * passed.megabytes / static_cast<double>(passed.arrived), passed.dropped));
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  raystage::run(argc > 1 ? std::atof(argv[1]) : 10, argc > 2 ? std::atoi(argv[2]) : 2);
  return 0;
}
