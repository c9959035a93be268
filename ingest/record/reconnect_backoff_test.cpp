// SPDX-License-Identifier: Apache-2.0
// Tests that a lost camera is reconnected.
#include <gtest/gtest.h>

#include <thread>

#include "base/error.h"
#include "ingest/record/camera_capture.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Outcome = FrameSource::Outcome;

/// A simulated camera that only one program can open at a time, and counts of its use.
struct Device {
  int opened = 0;
  bool taken = false;
  std::vector<Outcome> outcomes;  ///< of the n-th opened source, for every call
  int patience = 2000;            ///< calls, of about 1 ms, until the test stops
  std::stop_source stop;
};

class DeviceSource final : public FrameSource {
 public:
  explicit DeviceSource(Device& device) : device_(device) {
    if (device.taken) throw Error::failed("busy", "device", "close it");
    device.taken = true;
    outcome_ = device.outcomes.at(device.opened++);
  }
  ~DeviceSource() override { device_.taken = false; }
  const SourceDescription& description() const override { return description_; }
  Outcome next(SourceFrame& /*frame*/, std::chrono::milliseconds /*patience*/) override {
    std::this_thread::sleep_for(1ms);
    if (--device_.patience < 0) device_.stop.request_stop();
    return outcome_;
  }

 private:
  Device& device_;
  SourceDescription description_;
  Outcome outcome_;
};

class Reconnect : public ::testing::Test {
 protected:
  void run() {
    CameraCapture::Options options;
    options.when_lost = CameraCapture::LostSourcePolicy::kReconnect;
    options.lost_after = 30ms;
    options.reconnect = pauses;
    FrameQueue queue;
    MemoryBudget memory(1000), records(1000);
    EncoderPool encoders({}, 1);
    CameraCapture intake(options, std::make_unique<DeviceSource>(device), reopen,
                         {queue, memory, records, encoders, counters, host_clock, [] {}});
    intake.run(device.stop.get_token());
  }

  Device device;
  ReconnectBackoff::Limits pauses;
  CameraCounters counters;
  HostClock host_clock;
  CameraCapture::Open reopen = [this, tries = 0]() mutable {
    if (++tries > 5) device.stop.request_stop();
    return std::make_unique<DeviceSource>(device);
  };
};

TEST_F(Reconnect, LetsGoOfTheDeviceBeforeItIsOpenedAgain) {
  device.outcomes = {Outcome::kLost, Outcome::kEnded};
  run();
  EXPECT_EQ(device.opened, 2);
  EXPECT_EQ(counters.state, CameraCounters::State::kEnded);
}

TEST_F(Reconnect, TriesAgainWhereTheNewSourceIsSilentToo) {
  device.outcomes = {Outcome::kNoData, Outcome::kNoData, Outcome::kNoData, Outcome::kEnded};
  run();
  EXPECT_EQ(device.opened, 4);
  EXPECT_EQ(counters.state, CameraCounters::State::kEnded);
}

TEST_F(Reconnect, MayBeStoppedWhileThereIsNoSource) {
  device.outcomes = {Outcome::kLost};
  reopen = [this]() -> std::unique_ptr<FrameSource> {
    EXPECT_FALSE(device.taken);
    device.stop.request_stop();
    throw Error::failed("gone", "device", "wait");
  };
  run();
  EXPECT_EQ(counters.state, CameraCounters::State::kLost);
}

TEST_F(Reconnect, PausesLongerAndLongerWhereTheNewSourceDiesAtOnce) {
  pauses = {.initial = 20ms, .maximum = 80ms};
  device.outcomes = {Outcome::kLost, Outcome::kLost, Outcome::kLost,
                     Outcome::kLost, Outcome::kLost, Outcome::kEnded};
  const auto start = std::chrono::steady_clock::now();
  run();
  EXPECT_EQ(device.opened, 6);
  EXPECT_GE(std::chrono::steady_clock::now() - start, 0ms + 20ms + 40ms + 80ms + 80ms);
}

TEST_F(Reconnect, MayBeStoppedInAPause) {
  pauses = {.initial = 60s, .maximum = 60s};
  device.outcomes = {Outcome::kLost, Outcome::kLost, Outcome::kEnded};
  const auto start = std::chrono::steady_clock::now();
  const std::jthread stopper([this] {
    std::this_thread::sleep_for(100ms);
    device.stop.request_stop();
  });
  run();
  EXPECT_EQ(device.opened, 2);
  EXPECT_LT(std::chrono::steady_clock::now() - start, 30s);
}

TEST(ReconnectBackoff, DoublesUpToALimitAndStartsAnewAfterSteadyFrames) {
  ReconnectBackoff pause({});
  for (const int expected : {0, 250, 500, 1000, 2000, 4000, 5000, 5000}) {
    EXPECT_EQ(pause.next(), std::chrono::milliseconds(expected));
  }
  pause.report_uptime(9s);
  EXPECT_EQ(pause.next(), 5s);
  pause.report_uptime(10s);
  EXPECT_EQ(pause.next(), 0s);
  EXPECT_EQ(pause.next(), 250ms);
}

}  // namespace
}  // namespace raystage::ingest
