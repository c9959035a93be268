// SPDX-License-Identifier: Apache-2.0
// Tests live streams that stall, break or arrive in pieces.
#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <future>

#include "base/error.h"
#include "ingest/sources/ffmpeg_source.h"
#include "testing/ingest/test_pictures.h"
#include "testing/ingest/test_program.h"
#include "testing/ingest/test_server.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Outcome = FrameSource::Outcome;
using Options = std::map<std::string, std::string>;

std::unique_ptr<FrameSource> open(const std::string& url, const std::string& format = "",
                                  const Options& options = {}) {
  return open_ffmpeg_source({.url = url, .format = format, .options = options, .realtime = false},
                            "/");
}

constexpr const char* kMultipart =
    "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n--frame\r\n";

void send_part(const testing::TestConnection& client, std::span<const std::byte> jpeg) {
  client.send(fmt::format("Content-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.size()));
  client.send(jpeg);
  client.send("\r\n--frame\r\n");
}

TEST(FfmpegStream, MultipartJpegComesByteForByteAndSizesMayChange) {
  const std::vector<std::vector<std::byte>> given{
      testing::test_jpeg(64, 48, 40), testing::test_jpeg(64, 48, 90),
      testing::test_jpeg(32, 24, 120), testing::test_jpeg(64, 48, 200)};
  const testing::TestServer server([&](const testing::TestConnection& client) {
    client.request();
    client.send(kMultipart);
    for (const auto& jpeg : given) send_part(client, jpeg);
  });
  const auto source = open(server.url("http"));
  EXPECT_EQ(source->description().width, 64);
  EXPECT_EQ(source->description().height, 48);
  EXPECT_TRUE(source->description().delivers_jpeg);
  EXPECT_TRUE(source->description().live);
  EXPECT_EQ(source->description().timestamp_event, "arrival");
  EXPECT_THAT(source->description().what, ::testing::HasSubstr("mpjpeg http://127.0.0.1"));
  SourceFrame frame;
  Nanoseconds before = 0;
  for (const auto& jpeg : given) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    EXPECT_EQ(frame.jpeg, jpeg);
    EXPECT_FALSE(frame.torn);
    EXPECT_FALSE(frame.device_time || frame.sequence);
    EXPECT_GE(frame.arrival_steady, before);
    EXPECT_NEAR(static_cast<double>(frame.arrival_steady), static_cast<double>(host_steady_now()),
                5e9);
    before = frame.arrival_steady;
  }
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kLost);
  EXPECT_FALSE(source->loss_reason().empty());
  EXPECT_EQ(source->next(frame, 0ms), Outcome::kLost);
}

TEST(FfmpegStream, TornJpegIsKeptAndMarked) {
  const auto whole = testing::test_jpeg(64, 48, 40);
  auto cut = whole;
  cut.resize(cut.size() / 2);
  std::vector<std::byte> rubbish(500, std::byte{'x'});
  const testing::TestServer server([&](const testing::TestConnection& client) {
    client.request();
    client.send(kMultipart);
    send_part(client, whole);
    send_part(client, cut);
    send_part(client, rubbish);
    send_part(client, whole);
    // The connection breaks in the middle of a picture.
    client.send(
        fmt::format("Content-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", whole.size()));
    client.send(cut);
  });
  const auto source = open(server.url("http"));
  SourceFrame frame;
  for (const auto& [bytes, torn] :
       {std::pair{whole, false}, {cut, true}, {rubbish, true}, {whole, false}, {cut, true}}) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    EXPECT_EQ(frame.jpeg, bytes);
    EXPECT_EQ(frame.torn, torn);
  }
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kLost);
}

TEST(FfmpegStream, AStallLosesNothingAndCanBeInterrupted) {
  const auto first = testing::test_jpeg(64, 48, 40), second = testing::test_jpeg(64, 48, 90);
  std::promise<void> go_on;
  const testing::TestServer server(
      [&, go = go_on.get_future().share()](const testing::TestConnection& client) {
        client.request();
        client.send(kMultipart);
        send_part(client, first);
        client.send(
            fmt::format("Content-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", second.size()));
        const std::span<const std::byte> bytes(second);
        client.send(bytes.first(100));
        go.wait_for(20s);
        client.send(bytes.subspan(100));
        client.send("\r\n--frame\r\n");
        client.wait_for_end();
      });
  const auto source = open(server.url("http"), "mpjpeg");
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  auto start = Clock::now();
  EXPECT_EQ(source->next(frame, 50ms), Outcome::kNoData);
  EXPECT_GE(Clock::now() - start, 50ms);
  EXPECT_LT(Clock::now() - start, 1000ms);
  start = Clock::now();
  std::thread other([&] {
    std::this_thread::sleep_for(50ms);
    source->interrupt();
  });
  EXPECT_EQ(source->next(frame, 10s), Outcome::kNoData);
  EXPECT_LT(Clock::now() - start, 5s);
  other.join();
  go_on.set_value();
  ASSERT_EQ(source->next(frame, 5s), Outcome::kFrame);
  EXPECT_EQ(frame.jpeg, second) << "the frame before the stall was lost";
  EXPECT_FALSE(frame.torn);
}

TEST(FfmpegStream, AStalledSourceCanBeClosedAtOnce) {
  const testing::TestServer server([&](const testing::TestConnection& client) {
    client.request();
    client.send(kMultipart);
    send_part(client, testing::test_jpeg(64, 48, 40));
    client.wait_for_end();
  });
  auto source = open(server.url("http"), "mpjpeg");
  const auto start = Clock::now();
  source.reset();
  EXPECT_LT(Clock::now() - start, 2s);
}

TEST(FfmpegStream, JpegsInARowOverTcp) {
  std::vector<std::vector<std::byte>> given;
  for (int shade = 20; shade < 120; shade += 10) given.push_back(testing::test_jpeg(64, 48, shade));
  const testing::TestServer server([&](const testing::TestConnection& client) {
    for (const auto& jpeg : given) client.send(jpeg);
  });
  const auto source = open(server.url("tcp"), "mjpeg");
  EXPECT_EQ(source->description().width, 64);
  SourceFrame frame;
  for (const auto& jpeg : given) {
    ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
    EXPECT_EQ(frame.jpeg, jpeg);
  }
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kLost);
}

TEST(FfmpegStream, WhatDoesNotAnswerIsAFailureNotBadInput) {
  const testing::TestServer silent(
      [](const testing::TestConnection& client) { client.wait_for_end(); });
  try {
    open(silent.url("http"), "", {{"timeout", "300000"}});  // microseconds
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kFailed) << error.what();
  }
  EXPECT_THROW(open("tcp://127.0.0.1:1", "mjpeg"), Error);  // no server
}

TEST(FfmpegStream, OptionsThatNobodyKnowsAreNamed) {
  const testing::TestServer server([&](const testing::TestConnection& client) {
    client.request();
    client.send(kMultipart);
    send_part(client, testing::test_jpeg(64, 48, 40));
    client.wait_for_end();
  });
  try {
    open(server.url("http"), "mpjpeg", {{"user_agent", "raystage"}, {"vidoe_size", "1x1"}});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("\"vidoe_size\""));
    EXPECT_THAT(error.what(), ::testing::Not(::testing::HasSubstr("user_agent")));
  }
}

class Pipe {
 public:
  Pipe() {
    if (pipe2(ends_.data(), O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  }
  ~Pipe() {
    close(ends_[0]);
    hang_up();
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  std::string url() const { return fmt::format("pipe:{}", ends_[0]); }
  void send(std::span<const std::uint8_t> bytes) const {
    ASSERT_EQ(write(ends_[1], bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  void hang_up() {
    if (ends_[1] >= 0) close(ends_[1]);
    ends_[1] = -1;
  }

 private:
  std::array<int, 2> ends_{-1, -1};
};

const Options kRaw{{"pixel_format", "yuvj420p"}, {"video_size", "32x24"}, {"framerate", "50"}};
constexpr std::size_t kRawBytes = 32 * 24 * 3 / 2;

TEST(FfmpegStream, RawVideoFromAPipeComesAsItIs) {
  Pipe pipe;
  std::vector<std::uint8_t> bytes(kRawBytes);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
  pipe.send(bytes);
  const auto source = open(pipe.url(), "rawvideo", kRaw);
  EXPECT_EQ(source->description().width, 32);
  EXPECT_EQ(source->description().fps, 50);
  EXPECT_FALSE(source->description().delivers_jpeg);
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  SourceFrame none;
  EXPECT_EQ(source->next(none, 30ms), Outcome::kNoData);
  EXPECT_EQ(frame.raw.format, store::PixelFormat::kYuv420);
  std::vector<std::uint8_t> got;
  for (std::size_t plane = 0; plane < 3; ++plane) {
    const std::size_t w = plane == 0 ? 32 : 16, h = plane == 0 ? 24 : 12;
    for (std::size_t y = 0; y < h; ++y) {
      for (std::size_t x = 0; x < w; ++x) {
        got.push_back(std::to_integer<std::uint8_t>(
            frame.raw.planes[plane].data[y * frame.raw.planes[plane].stride + x]));
      }
    }
  }
  EXPECT_EQ(got, bytes);
  pipe.send(std::span(bytes).first(kRawBytes / 2));
  pipe.hang_up();
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  EXPECT_TRUE(frame.torn);
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kEnded);
}

TEST(FfmpegStream, PicturesOutliveTheirSource) {
  Pipe pipe;
  pipe.send(std::vector<std::uint8_t>(kRawBytes, 11));
  auto source = open(pipe.url(), "rawvideo", kRaw);
  SourceFrame first, second;
  pipe.send(std::vector<std::uint8_t>(kRawBytes, 22));
  ASSERT_EQ(source->next(first, 2000ms), Outcome::kFrame);
  ASSERT_EQ(source->next(second, 2000ms), Outcome::kFrame);
  source.reset();
  EXPECT_EQ(first.raw.planes[0].data[100], std::byte{11});
  EXPECT_EQ(second.raw.planes[2].data[3], std::byte{22});
}

TEST(FfmpegStream, ASilentPipeCanBeClosedAtOnce) {
  const Pipe pipe;
  pipe.send(std::vector<std::uint8_t>(100, 11));
  auto source = open(pipe.url(), "rawvideo", kRaw);
  const auto start = Clock::now();
  source.reset();
  EXPECT_LT(Clock::now() - start, 2s);
}

TEST(FfmpegStream, ANamedPipeMayBeOpenedBeforeItsWriter) {
  const testing::TestFolder folder;
  const auto name = folder.path() / "camera";
  ASSERT_EQ(mkfifo(name.c_str(), 0600), 0);
  const std::vector<std::uint8_t> bytes(kRawBytes, 33);
  std::thread writer([&] {
    std::this_thread::sleep_for(100ms);
    const int pipe = ::open(name.c_str(), O_WRONLY | O_CLOEXEC);
    EXPECT_EQ(write(pipe, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
    close(pipe);
  });
  const auto source = open(name.string(), "rawvideo", kRaw);
  writer.join();
  SourceFrame frame;
  ASSERT_EQ(source->next(frame, 2000ms), Outcome::kFrame);
  EXPECT_EQ(frame.raw.planes[0].data[5], std::byte{33});
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kEnded);
}

int free_port() {
  const testing::TestServer server([](const testing::TestConnection&) {});
  return server.port();
}

class Rtsp : public ::testing::TestWithParam<const char*> {};

TEST_P(Rtsp, FramesComeWithTheSendersStampsUntilItDies) {
  if (std::system("ffmpeg -version > /dev/null 2>&1") != 0) GTEST_SKIP() << "there is no ffmpeg";
  const std::string url = fmt::format("rtsp://127.0.0.1:{}/camera", free_port());
  // The sender retries until the source listens.
  testing::TestProgram sender(fmt::format(
      "for i in 1 2 3 4 5 6 7 8 9; do ffmpeg -v quiet -nostdin -re -f lavfi -i "
      "testsrc=size=320x240:rate=25 -pix_fmt {} -f rtsp -rtsp_transport tcp {}; sleep 0.3; done",
      GetParam(), url));
  const auto source = open(url, "rtsp", {{"rtsp_flags", "listen"}, {"rtsp_transport", "tcp"}});
  const bool jpeg = std::string_view(GetParam()).find("mjpeg") != std::string_view::npos;
  EXPECT_EQ(source->description().width, 320);
  EXPECT_EQ(source->description().clock, "device");
  EXPECT_EQ(source->description().delivers_jpeg, jpeg);
  SourceFrame frame;
  std::optional<Nanoseconds> last;
  for (int i = 0; i < 15; ++i) {
    ASSERT_EQ(source->next(frame, 5s), Outcome::kFrame);
    // FFmpeg may not have the time of the first picture.
    ASSERT_TRUE(frame.device_time || i == 0) << i;
    if (last) {
      EXPECT_NEAR(static_cast<double>(*frame.device_time - *last), 40e6, 1e6);
    }
    last = frame.device_time;
    EXPECT_FALSE(frame.torn);
    EXPECT_EQ(frame.jpeg.empty(), !jpeg);
    if (!jpeg) {
      EXPECT_EQ(frame.raw.format, store::PixelFormat::kYuv420);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, Rtsp,
                         ::testing::Values("yuvj420p -c:v mjpeg -huffman 0",
                                           "yuv420p -c:v libx264 -bf 0 -g 10"));

TEST(FfmpegStream, DevicesAreLoadedWhenAskedFor) {
  const auto source = open("lavfi:testsrc=size=64x48:rate=20:duration=0.5");
  EXPECT_EQ(source->description().width, 64);
  EXPECT_EQ(source->description().fps, 20);
  SourceFrame frame;
  int frames = 0;
  while (source->next(frame, 2000ms) == Outcome::kFrame) {
    EXPECT_EQ(frame.raw.format, store::PixelFormat::kRgb);
    ++frames;
  }
  EXPECT_EQ(frames, 10);
  EXPECT_EQ(source->next(frame, 2000ms), Outcome::kEnded);
  EXPECT_FALSE(source->description().live);
}

// Decoders and filter graphs never free pictures that were in use at once.
TEST(FfmpegStream, MemoryBesideIsThatOfItsPictures) {
  const std::size_t small =
      open("lavfi:testsrc=size=640x480:rate=20:duration=0.5")->memory_overhead();
  const std::size_t large =
      open("lavfi:testsrc=size=1280x960:rate=20:duration=0.5")->memory_overhead();
  constexpr std::size_t kPicture = std::size_t{640} * 480 * 3;
  EXPECT_GT(small, 10 * kPicture);
  EXPECT_LT(small, 20 * kPicture);
  EXPECT_GT(large, small + 30 * kPicture);
}

TEST(FfmpegStream, AGraphThatKeepsRealTimeIsACamera) {
  const auto source = open("lavfi:testsrc=size=64x48:rate=50:duration=0.4,realtime");
  EXPECT_TRUE(source->description().live);
  SourceFrame frame;
  Outcome outcome = Outcome::kFrame;
  while ((outcome = source->next(frame, 2000ms)) == Outcome::kFrame) {
  }
  EXPECT_EQ(outcome, Outcome::kLost);
}

}  // namespace
}  // namespace raystage::ingest
