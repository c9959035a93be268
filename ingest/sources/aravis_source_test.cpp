// SPDX-License-Identifier: Apache-2.0
// Tests with Aravis' fake cameras, which use GigE Vision over loopback. Each needs its own address,
// and the protocol a free port: a network namespace provides both and leaves no traces.
#include "ingest/sources/aravis_source.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <thread>

#include "base/error.h"
#include "ingest/sources/aravis_camera.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Outcome = FrameSource::Outcome;

constexpr int kAddresses = 4;

/// Adds 127.0.0.1 to 127.0.0.4 to the loopback device of this thread's network namespace.
bool add_addresses() {
  const int control = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  bool good = control >= 0;
  for (int i = 0; good && i < kAddresses; ++i) {
    ifreq request{};
    fmt::format_to_n(static_cast<char*>(request.ifr_name), IFNAMSIZ - 1, "{}",
                     i == 0 ? "lo" : fmt::format("lo:{}", i));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK + static_cast<std::uint32_t>(i));
    std::memcpy(&request.ifr_addr, &address, sizeof(address));
    good = ioctl(control, SIOCSIFADDR, &request) == 0;
    address.sin_addr.s_addr = htonl(0xFF000000);
    std::memcpy(&request.ifr_netmask, &address, sizeof(address));
    good = good && ioctl(control, SIOCSIFNETMASK, &request) == 0;
    request.ifr_flags = IFF_UP | IFF_RUNNING | IFF_LOOPBACK;
    good = good && ioctl(control, SIOCSIFFLAGS, &request) == 0;
  }
  if (control >= 0) close(control);
  return good;
}

class AravisSourceTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const bool apart = unshare(CLONE_NEWNET) == 0 || unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0;
    alone_ = apart && add_addresses();
  }

  void SetUp() override {
    if (!alone_) GTEST_SKIP() << "no network namespace of our own is permitted here";
  }

  /// Starts a camera at 127.0.0.(1 + index) with the serial number "Sindex".
  ArvGvFakeCamera* start(int index) {
    cameras_.emplace_back(arv_gv_fake_camera_new(fmt::format("127.0.0.{}", index + 1).c_str(),
                                                 fmt::format("S{}", index).c_str()));
    EXPECT_TRUE(arv_gv_fake_camera_is_running(cameras_.back().get()));
    return cameras_.back().get();
  }

  /// Returns settings for loopback and a camera that does not resend packets.
  static schemas::RecordConfig::AravisSource settings(int index) {
    schemas::RecordConfig::AravisSource source;
    source.device = fmt::format("Aravis-Fake-S{}", index);
    source.fps = 50;
    source.pixel_format = "Mono8";
    source.packet_resend = false;
    source.packet_socket = false;
    return source;
  }

  std::vector<GObjectPtr<ArvGvFakeCamera>> cameras_;

 private:
  static inline bool alone_ = false;
};

/// Waits for the first complete frame. Aravis enlarges the socket's buffer at the first packet. The
/// rest of that frame may already have overrun it over loopback, and those that follow on a busy
/// machine.
bool first_whole(FrameSource& source, SourceFrame& frame) {
  for (int i = 0; i < 100; ++i) {
    if (source.next(frame, 3000ms) == Outcome::kFrame && !frame.torn) return true;
  }
  return false;
}

TEST_F(AravisSourceTest, FramesComeWholeWithCounterAndDeviceTime) {
  start(0);
  const auto source = open_aravis_source(settings(0));
  EXPECT_EQ(source->description().width, 512);
  EXPECT_EQ(source->description().height, 512);
  EXPECT_NEAR(source->description().fps, 50, 0.01);
  EXPECT_EQ(source->description().clock, "device");
  EXPECT_THAT(source->description().what, ::testing::HasSubstr(" S0, Mono8"));
  SourceFrame frame;
  ASSERT_TRUE(first_whole(*source, frame));
  std::uint64_t number = 0, first_number = 0;
  Nanoseconds stamp = 0, first_stamp = 0;
  for (int i = 0; i < 30; ++i) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    EXPECT_FALSE(frame.torn);
    EXPECT_EQ(frame.raw.format, store::PixelFormat::kGray);
    EXPECT_EQ(frame.raw.width, 512);
    ASSERT_TRUE(frame.sequence && frame.device_time);
    if (i == 0) {
      first_number = *frame.sequence, first_stamp = *frame.device_time;
    } else {
      EXPECT_EQ(*frame.sequence, number + 1);
      EXPECT_GT(*frame.device_time, stamp);
    }
    EXPECT_NEAR(static_cast<double>(frame.arrival_steady), static_cast<double>(host_steady_now()),
                1e9);
    number = *frame.sequence;
    stamp = *frame.device_time;
  }
  // A busy machine delays the fake camera.
  const double period =
      static_cast<double>(stamp - first_stamp) / static_cast<double>(number - first_number);
  EXPECT_GT(period, 18e6);
  EXPECT_LT(period, 60e6);
}

TEST_F(AravisSourceTest, TheRateOfATriggeredCameraIsThatOfItsTrigger) {
  start(0);
  auto config = settings(0);
  config.trigger = "Line0";
  EXPECT_EQ(open_aravis_source(config)->description().fps, 50) << "as configured";
  config.fps.reset();
  EXPECT_EQ(open_aravis_source(config)->description().fps, 0) << "unknown";
}

TEST_F(AravisSourceTest, MemoryBesideIsThatOfItsBuffers) {
  start(0);
  auto config = settings(0);
  constexpr std::size_t kPicture = 512 * 512;
  config.buffers = 10;
  const std::size_t ten = open_aravis_source(config)->memory_overhead();
  EXPECT_GE(ten, 10 * kPicture);
  config.buffers = 30;
  EXPECT_EQ(open_aravis_source(config)->memory_overhead(), ten + 20 * kPicture);
}

TEST_F(AravisSourceTest, TheCounterGoesOnWhereSixteenBitsEnd) {
  start(0);
  auto config = settings(0);
  config.fps = 150;
  const auto source = open_aravis_source(config);
  SourceFrame frame;
  ASSERT_TRUE(first_whole(*source, frame));
  // The fake camera begins a few hundred frames before its ids wrap.
  ASSERT_LT(*frame.sequence, 65535U);
  const auto give_up = Clock::now() + 30s;
  std::uint64_t last = *frame.sequence;
  while (last < 65600 && Clock::now() < give_up) {
    ASSERT_EQ(source->next(frame, 3000ms), Outcome::kFrame);
    ASSERT_GT(*frame.sequence, last);
    ASSERT_LT(*frame.sequence, last + 1000);
    last = *frame.sequence;
  }
  EXPECT_GE(last, 65600U);
}

TEST_F(AravisSourceTest, SeveralCamerasAtOnce) {
  constexpr int kCameras = 3, kFrames = 25;
  std::vector<std::unique_ptr<FrameSource>> sources;
  for (int i = 0; i < kCameras; ++i) {
    start(i);
    sources.push_back(open_aravis_source(settings(i)));
  }
  std::vector<int> whole(kCameras, 0);
  std::vector<std::thread> readers;
  for (std::size_t i = 0; i < kCameras; ++i) {
    readers.emplace_back([&, i] {
      SourceFrame frame;
      if (!first_whole(*sources[i], frame)) return;
      for (int n = 0; n < kFrames; ++n) {
        if (sources[i]->next(frame, 2000ms) == Outcome::kFrame && !frame.torn) ++whole[i];
      }
    });
  }
  for (std::thread& reader : readers) reader.join();
  EXPECT_THAT(whole, ::testing::Each(kFrames));
}

TEST_F(AravisSourceTest, PixelFormatsBecomeOurs) {
  start(0);
  for (const auto& [name, expected] : {std::pair{"Mono8", store::PixelFormat::kGray},
                                       {"Mono16", store::PixelFormat::kGray},
                                       {"RGB8", store::PixelFormat::kRgb},
                                       {"BayerRG8", store::PixelFormat::kRgb},
                                       {"BayerBG8", store::PixelFormat::kRgb},
                                       {"BayerGR8", store::PixelFormat::kRgb},
                                       {"BayerGB8", store::PixelFormat::kRgb}}) {
    auto config = settings(0);
    config.pixel_format = name;
    const auto source = open_aravis_source(config);
    SourceFrame frame;
    ASSERT_TRUE(first_whole(*source, frame)) << name;
    EXPECT_EQ(frame.raw.format, expected) << name;
    EXPECT_EQ(frame.raw.width, 512) << name;
    // The fake camera draws a pattern, not one grey.
    const auto& plane = frame.raw.planes[0];
    EXPECT_NE(plane.data[0], plane.data[100 * plane.stride + 90]) << name;
  }
}

TEST_F(AravisSourceTest, FramesWithLostPacketsAreTornAndCounted) {
  ArvGvFakeCamera* camera = start(0);
  g_object_set(camera, "gvsp-lost-ratio", 0.003, nullptr);  // of some 180 packets a frame
  const auto source = open_aravis_source(settings(0));
  int torn = 0;
  SourceFrame frame;
  std::optional<std::uint64_t> last;
  for (int i = 0; i < 40; ++i) {
    ASSERT_EQ(source->next(frame, 3000ms), Outcome::kFrame);
    if (frame.torn) ++torn;
    EXPECT_EQ(frame.raw.width, 512);  // the received part is kept
    if (frame.sequence && last) {
      EXPECT_GT(*frame.sequence, *last);
    }
    last = frame.sequence;
  }
  EXPECT_GT(torn, 2);
  EXPECT_LT(torn, 38);
}

TEST_F(AravisSourceTest, ALateReaderSeesTheGapInTheCounter) {
  start(0);
  auto config = settings(0);
  config.buffers = 3;
  const auto source = open_aravis_source(config);
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  std::this_thread::sleep_for(500ms);  // 25 frames
  std::uint64_t before = frame.sequence.value(), largest_step = 0;
  for (int i = 0; i < 6; ++i) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    largest_step = std::max(largest_step, *frame.sequence - before);
    before = *frame.sequence;
  }
  EXPECT_GT(largest_step, 10U);
}

TEST_F(AravisSourceTest, PicturesMayBeKeptAndOutliveTheirSource) {
  start(0);
  auto config = settings(0);
  config.buffers = 4;
  auto source = open_aravis_source(config);
  SourceFrame first;
  ASSERT_TRUE(first_whole(*source, first));
  std::vector<SourceFrame> kept(12);
  std::vector<std::byte> seen;
  for (SourceFrame& frame : kept) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    seen.push_back(frame.raw.planes[0].data[1000]);
  }
  source.reset();
  for (std::size_t i = 0; i < kept.size(); ++i) {
    EXPECT_EQ(kept[i].raw.planes[0].data[1000], seen[i]);
  }
}

TEST_F(AravisSourceTest, ACameraThatGoesAwayIsLost) {
  start(0);
  const auto source = open_aravis_source(settings(0));
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  cameras_.clear();
  Outcome last = Outcome::kFrame;
  const auto start = Clock::now();
  while (last != Outcome::kLost && Clock::now() - start < 30s) last = source->next(frame, 200ms);
  EXPECT_EQ(last, Outcome::kLost);
  EXPECT_FALSE(source->loss_reason().empty());
}

TEST_F(AravisSourceTest, ATriggeredCameraWaitsAndCanBeInterrupted) {
  start(0);
  auto config = settings(0);
  config.trigger = "Software";
  const auto source = open_aravis_source(config);
  SourceFrame frame;
  EXPECT_EQ(source->next(frame, 200ms), Outcome::kNoData);
  const auto start = Clock::now();
  std::thread other([&] {
    std::this_thread::sleep_for(50ms);
    source->interrupt();
  });
  EXPECT_EQ(source->next(frame, 10s), Outcome::kNoData);
  EXPECT_LT(Clock::now() - start, 5s);
  other.join();
}

TEST_F(AravisSourceTest, CamerasAreFoundByIdSerialNumberAndAddress) {
  start(1);
  for (const char* name : {"Aravis-Fake-S1", "S1", "127.0.0.2", ""}) {
    auto config = settings(1);
    config.device = name;
    const auto source = open_aravis_source(config);
    EXPECT_THAT(source->description().what, ::testing::HasSubstr(" S1,")) << name;
  }
  auto config = settings(1);
  config.device = "S7";
  try {
    open_aravis_source(config);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("found: Aravis-Fake-S1"));
  }
}

TEST_F(AravisSourceTest, SettingsThatTheCameraDoesNotTakeAreNamed) {
  start(0);
  const auto refusal = [](const schemas::RecordConfig::AravisSource& config) -> std::string {
    try {
      open_aravis_source(config);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "accepted";
  };
  auto config = settings(0);
  config.exposure_us = 1e9;
  EXPECT_THAT(refusal(config),
              ::testing::HasSubstr("exposure_us is 1000000000, the camera allows"));
  config = settings(0);
  config.gain = 99;
  EXPECT_THAT(refusal(config), ::testing::HasSubstr("gain is 99, the camera allows: 0 to 10"));
  config = settings(0);
  config.fps = 1e5;
  EXPECT_THAT(refusal(config), ::testing::HasSubstr("fps is 100000"));
  config = settings(0);
  config.pixel_format = "Mono9";
  EXPECT_THAT(refusal(config), ::testing::AllOf(::testing::HasSubstr("rejected pixel_format"),
                                                ::testing::HasSubstr("BayerRG8")));
  config = settings(0);
  config.trigger = "Line77";
  EXPECT_THAT(refusal(config), ::testing::HasSubstr("trigger"));
  config = settings(0);
  config.exposure_us = 5000;
  config.gain = 2;
  EXPECT_EQ(refusal(config), "accepted");
}

}  // namespace
}  // namespace raystage::ingest
