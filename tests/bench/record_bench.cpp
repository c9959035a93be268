// SPDX-License-Identifier: Apache-2.0
// Measures how much one node can record, against libjpeg-turbo alone and FFmpeg, in one run.
// Usage: record_bench [SECONDS [THREADS [ROW...]]]: length of each measurement (default 10),
// encoder threads (default 2), and which rows (default all): raw load small held jpeg.
// RAYSTAGE_BENCH_PICTURES: a folder of JPEG photographs; without it synthetic pictures.
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
#include <map>
#include <thread>

#include "base/atomic_file.h"
#include "ingest/record/open_cameras.h"
#include "ingest/record/record_setup.h"
#include "store/jpeg/decode.h"
#include "testing/ingest/scripted_source.h"
#include "testing/test_folder.h"
#include "tests/bench/bench_frames.h"

namespace raystage {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kCameras = 64, kQuality = 90;
constexpr int kThesisQuality = 27;  // about 10 KB per frame of 320x240, as in the thesis

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The resources that this process or its children have used so far.
struct Usage {
  double user = 0, system = 0;         ///< CPU time, seconds
  double page_faults = 0, sleeps = 0;  ///< counts
  double cpu() const { return user + system; }
};

Usage usage(int who) {
  rusage usage{};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return {seconds(usage.ru_utime), seconds(usage.ru_stime), static_cast<double>(usage.ru_minflt),
          static_cast<double>(usage.ru_nvcsw)};
}

Usage operator-(const Usage& a, const Usage& b) {
  return {a.user - b.user, a.system - b.system, a.page_faults - b.page_faults, a.sleeps - b.sleeps};
}

/// Measures libjpeg-turbo alone: frames per second on a number of threads.
double turbojpeg_rate(const std::vector<ingest::SourceFrame>& frames, int threads, double seconds) {
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
          const store::RawImage& raw = frames[i % frames.size()].raw;
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
  double seconds = 0;  ///< until all frames were on disk
  Usage used;
  std::uint64_t arrived = 0, stored = 0, dropped = 0;
  double megabytes = 0, peak_mb = 0;
  bool audit = false;
  std::string complaint;

  double fps() const { return static_cast<double>(stored) / seconds; }
  double cores() const { return used.cpu() / seconds; }
  double kilobytes() const { return 1e3 * megabytes / static_cast<double>(stored); }
  /// Returns the CPU time and other costs per frame as text.
  std::string costs() const {
    const auto frames = static_cast<double>(stored);
    return fmt::format(
        "{:.0f} us of CPU a frame, {:.0f} of them in the kernel; {:.1f} page faults, "
        "{:.2f} sleeps",
        1e6 * used.cpu() / frames, 1e6 * used.system / frames, used.page_faults / frames,
        used.sleeps / frames);
  }
};

Result record(const std::vector<ingest::SourceFrame>& frames, int cameras, double fps,
              double seconds, ingest::RecorderOptions options) {
  const testing::TestFolder folder;
  schemas::RecordConfig config;
  config.name = "bench";
  for (int i = 0; i < cameras; ++i) {
    config.cameras.push_back({fmt::format("c{:02}", i), schemas::RecordConfig::SimulatedSource{}});
  }
  auto opened = ingest::open_cameras(config, [&](const schemas::RecordConfig::Camera&) {
    testing::SourceScript script;
    script.frames = frames;
    script.fps = fps;
    return testing::make_scripted_source(script);
  });
  ingest::RecordingTake take = ingest::RecordingTake::create(
      folder.path() / "take",
      ingest::make_take_document(config, opened, "n", ingest::host_utc_now(), "bench"),
      ingest::make_recording_rig(config, {}, opened), "n");
  options.duration_s = seconds;
  ingest::Recorder recorder(options, std::move(opened), take, "bench");
  const Usage before = usage(RUSAGE_SELF);
  const auto start = Clock::now();
  const auto session = recorder.run({});
  Result result;
  result.seconds = seconds_since(start);
  result.used = usage(RUSAGE_SELF) - before;
  for (const auto& camera : session.cameras) {
    result.arrived += camera.arrived;
    result.stored += camera.stored;
    for (const auto& [reason, count] : camera.dropped) result.dropped += count;
    result.dropped += camera.skipped_by_source;
  }
  for (const auto& file : std::filesystem::directory_iterator(folder.path() / "take" / "archive")) {
    result.megabytes += static_cast<double>(file.file_size()) / 1e6;
  }
  result.peak_mb = static_cast<double>(session.memory_peak_bytes) / 1e6;
  result.audit = session.audit && session.audit->holds;
  if (!result.audit && session.audit) result.complaint = session.audit->problems.at(0);
  return result;
}

struct Ffmpeg {
  double frames_per_cpu_second = 0, psnr_db = 0;
  int scale = 0;
};

/// Measures FFmpeg's MJPEG recorder on the same pictures, at the quality with the nearest PSNR.
Ffmpeg ffmpeg_recorder(const std::vector<ingest::SourceFrame>& frames, double wanted_psnr) {
  const testing::TestFolder folder;
  const std::vector<store::RgbImage> truth = decoded(frames, 100);
  constexpr int kRepeats = 60;
  const auto raw = folder.path() / "s.yuv";
  const store::RawImage& first = frames[0].raw;
  const auto write_raw = [&](int repeats) {
    std::ofstream file(raw, std::ios::binary);
    for (int r = 0; r < repeats; ++r) {
      for (const ingest::SourceFrame& frame : frames) {
        file.write(reinterpret_cast<const char*>(frame.raw.planes[0].data),
                   static_cast<std::streamsize>(frame.raw.bytes()));
      }
    }
  };
  const auto run = [&](int scale, const std::string& output) {
    const double before = usage(RUSAGE_CHILDREN).cpu();
    const std::string command = fmt::format(
        "ffmpeg -v error -y -f rawvideo -pix_fmt yuvj420p -s {}x{} -r 30 -i '{}' -c:v "
        "mjpeg -q:v {} '{}/{}'",
        first.width, first.height, raw.string(), scale, folder.path().string(), output);
    if (std::system(command.c_str()) != 0) std::exit(1);
    return usage(RUSAGE_CHILDREN).cpu() - before;
  };
  Ffmpeg best;
  write_raw(1);
  for (int scale = 2; scale <= 12; ++scale) {
    run(scale, "%02d.jpg");
    std::vector<store::RgbImage> images;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const std::string bytes = read_file(folder.path() / fmt::format("{:02}.jpg", i + 1));
      images.push_back(store::JpegDecoder().decode(std::as_bytes(std::span(bytes)), "ffmpeg"));
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

/// Measures the cost of 64 threads that only wake up at this rate.
double idle_cores(double wakes_per_second, double seconds) {
  const Usage before = usage(RUSAGE_SELF);
  const auto start = Clock::now();
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < kCameras; ++t) {
      threads.emplace_back([&] {
        const std::chrono::duration<double> interval(1 / wakes_per_second);
        auto next = start;
        while (seconds_since(start) < seconds) {
          next += std::chrono::duration_cast<Clock::duration>(interval);
          std::this_thread::sleep_until(next);
        }
      });
    }
  }
  return (usage(RUSAGE_SELF) - before).cpu() / seconds_since(start);
}

void print(const std::string& what, const std::string& value, const Result& result) {
  fmt::print("| {} | {} | {} |\n", what, value, result.costs());
  std::fflush(stdout);
}

class Bench {
 public:
  Bench(double seconds, int threads) : seconds_(seconds), threads_(threads) {
    options_.threads = threads;
    options_.jpeg = {kQuality, store::JpegEncodeOptions::Chroma::k420, -1};
    options_.memory_bytes = 500'000'000;
  }

  void raw() {
    const double alone = turbojpeg_rate(vga_, threads_, seconds_);
    const Result full = record(vga_, kCameras, 1.15 * alone / kCameras, seconds_, options_);
    capacity_ = full.fps();
    print("64 raw streams 640x480 4:2:0, more than fits",
          fmt::format("{:.0f} frames/s stored, {:.0f} MB/s; libjpeg-turbo alone {:.0f} frames/s: "
                      "{:.1f} %; audit {}{}",
                      capacity_, full.megabytes / full.seconds, alone, 100 * capacity_ / alone,
                      full.audit ? "holds" : "FAILS: ", full.complaint),
          full);
    const double wanted = psnr(decoded(vga_, kQuality), decoded(vga_, 100));
    const Ffmpeg ffmpeg = ffmpeg_recorder(vga_, wanted);
    const double ours = static_cast<double>(full.stored) / full.used.cpu();
    print("frames per CPU second",
          fmt::format("{:.0f} at {:.2f} dB; ffmpeg -c:v mjpeg -q:v {} {:.0f} at {:.2f} dB: {:.2f} "
                      "times",
                      ours, wanted, ffmpeg.scale, ffmpeg.frames_per_cpu_second, ffmpeg.psnr_db,
                      ours / ffmpeg.frames_per_cpu_second),
          full);
  }

  void load() {
    if (capacity_ == 0) raw();
    const double length = 12 * seconds_;
    const Result load = record(vga_, kCameras, 0.9 * capacity_ / kCameras, length, options_);
    print(fmt::format("the same at 90 % of that for {:.0f} s", length),
          fmt::format("{} of {} frames dropped, {:.0f} MB of RAM at most (limit {:.0f})",
                      load.dropped, load.arrived, load.peak_mb, options_.memory_bytes / 1e6),
          load);
  }

  void small() {
    constexpr double kFps = 15;
    for (const int quality : {kQuality, kThesisQuality}) {
      options_.jpeg.quality = quality;
      const Result result = record(small_, kCameras, kFps, seconds_, options_);
      print(fmt::format("64 raw streams 320x240 at 15 fps, quality {}", quality),
            fmt::format("{:.1f} % of a core (waking alone {:.1f} %), {:.1f} KB a frame, {} dropped",
                        100 * result.cores(), 100 * idle_cores(kFps, seconds_), result.kilobytes(),
                        result.dropped),
            result);
    }
    options_.jpeg.quality = kQuality;
  }

  void held() {
    ingest::RecorderOptions options = options_;
    options.hold = true;
    for (const int quality : {kQuality, kThesisQuality}) {
      options.jpeg.quality = quality;
      const Result held = record(small_, 16, 15, seconds_, options);
      print(fmt::format("16 of them held in memory, quality {}", quality),
            fmt::format("{:.1f} minutes per GB ({:.1f} KB a frame), {} dropped",
                        1e9 / (held.peak_mb * 1e6 / seconds_) / 60, held.kilobytes(), held.dropped),
            held);
    }
  }

  void jpeg() {
    constexpr int kWebcamQuality = 70;  // about 50 KB per frame
    constexpr double kFps = 30;
    const auto jpegs = jpeg_frames(vga_, kWebcamQuality);
    const Result passed = record(jpegs, kCameras, kFps, seconds_, options_);
    print("64 JPEG streams 640x480 at 30 fps passed through",
          fmt::format("{:.1f} % of a core (waking alone {:.1f} %), {:.0f} MB/s, {:.0f} KB a frame, "
                      "{} dropped",
                      100 * passed.cores(), 100 * idle_cores(kFps, seconds_),
                      passed.megabytes / passed.seconds, passed.kilobytes(), passed.dropped),
          passed);
  }

 private:
  const double seconds_;
  const int threads_;
  ingest::RecorderOptions options_;
  const std::vector<ingest::SourceFrame> vga_ = raw_frames(load_bench_images(640, 480, 1)),
                                         small_ = raw_frames(load_bench_images(320, 240, 2));
  double capacity_ = 0;
};

void run(double seconds, int threads, std::vector<std::string> rows) {
  if (rows.empty()) rows = {"raw", "load", "small", "held", "jpeg"};
  fmt::print("| measured for {:.0f} s each, {} threads | | a frame costs |\n| --- | --- | --- |\n",
             seconds, threads);
  Bench bench(seconds, threads);
  const std::map<std::string, void (Bench::*)()> known{{"raw", &Bench::raw},
                                                       {"load", &Bench::load},
                                                       {"small", &Bench::small},
                                                       {"held", &Bench::held},
                                                       {"jpeg", &Bench::jpeg}};
  for (const std::string& row : rows) (bench.*known.at(row))();
}

}  // namespace
}  // namespace raystage

int main(int argc, char** argv) {
  const std::vector<std::string> rows(argv + std::min(argc, 3), argv + argc);
  raystage::run(argc > 1 ? std::atof(argv[1]) : 10, argc > 2 ? std::atoi(argv[2]) : 2, rows);
  return 0;
}
