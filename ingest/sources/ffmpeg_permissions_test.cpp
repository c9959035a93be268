// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/ffmpeg_permissions.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <csignal>
#include <fstream>
#include <thread>

#include "base/error.h"
#include "ingest/sources/ffmpeg_source.h"
#include "testing/ingest/test_pictures.h"
#include "testing/ingest/test_server.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Source = schemas::RecordConfig::FfmpegSource;
using Outcome = FrameSource::Outcome;

std::string refusal(const Source& source, SourcePermissions permissions = {}) {
  try {
    open_ffmpeg_source(source, "/", permissions);
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

TEST(FfmpegPermissions, FiltersAreFoundAsFfmpegFindsThem) {
  EXPECT_THAT(filters_of_graph("testsrc=size=96x64:rate=30,realtime"),
              ElementsAre("testsrc", "realtime"));
  EXPECT_THAT(filters_of_graph("color=red [a] ; movie=x.mov,scale@big=2:2[b];[a][b]overlay"),
              ElementsAre("color", "movie", "scale", "overlay"));
  EXPECT_THAT(filters_of_graph("sws_flags=bicubic;nullsrc"), ElementsAre("nullsrc"));
  EXPECT_THAT(filters_of_graph(R"(drawbox=text='a,movie=b;c' , mov\ie=x)"),
              ElementsAre("drawbox", "movie"));
  EXPECT_THAT(filters_of_graph("'mo'vie = file"), ElementsAre("movie"));
  EXPECT_THAT(filters_of_graph(""), ElementsAre());
  EXPECT_THAT(filters_of_graph("[a"), ElementsAre());
}

TEST(FfmpegPermissions, FiltersThatMayOpenFilesAreRefused) {
  const testing::TestFolder folder;
  const std::string file = (folder.path() / "written").string();
  for (const std::string& graph :
       {"testsrc,metadata=print:file=" + file, std::string("movie=/etc/passwd"),
        std::string("testsrc,'frei0r'=x"),
        std::string("testsrc,dra\\wtext=textfile=/etc/passwd")}) {
    EXPECT_THAT(refusal({.url = graph, .format = "lavfi"}), HasSubstr("may open files")) << graph;
    EXPECT_THAT(refusal({.url = "lavfi:" + graph}), HasSubstr("may open files")) << graph;
    EXPECT_THAT(refusal({.url = "x", .format = "lavfi", .options = {{"graph", graph}}}),
                HasSubstr("may open files"));
  }
  EXPECT_THAT(refusal({.url = "x", .format = "lavfi", .options = {{"graph_file", file}}}),
              HasSubstr("opens a file"));
  EXPECT_FALSE(std::filesystem::exists(file));
  const Source writes{.url = "testsrc=duration=1,metadata=print:file=" + file, .format = "lavfi"};
  EXPECT_EQ(refusal(writes, {.filters_with_files = true}), "");
  EXPECT_TRUE(std::filesystem::exists(file));
  EXPECT_EQ(refusal({.url = "testsrc=duration=1,scale=32:32", .format = "lavfi"}), "");
}

TEST(FfmpegPermissions, AddressesThatReadOthersAreRefused) {
  const testing::TestFolder folder;
  const auto movie = folder.path() / "secret.mjpeg";
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  std::ofstream(movie, std::ios::binary)
      .write(reinterpret_cast<const char*>(jpeg.data()), static_cast<std::streamsize>(jpeg.size()));
  for (const std::string scheme : {"concat:", "subfile,,start,0,end,0,,:", "async:", "cache:",
                                   "crypto:", "data:", "hls+file:"}) {
    EXPECT_THAT(refusal({.url = scheme + movie.string()}), HasSubstr("protocol_whitelist"))
        << scheme;
  }
  std::ofstream(folder.path() / "list.m3u8")
      << "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nfile://" << movie.string()
      << "\n#EXT-X-ENDLIST\n";
  EXPECT_NE(refusal({.url = (folder.path() / "list.m3u8").string()}), "") << "detected";
  EXPECT_THAT(refusal({.url = (folder.path() / "list.m3u8").string(), .format = "hls"}),
              HasSubstr("reads the addresses"));
  EXPECT_EQ(refusal({.url = movie.string()}), "") << "the movie itself is readable";
  EXPECT_EQ(refusal({.url = "async:" + movie.string(),
                     .options = {{"protocol_whitelist", "async,file"}}}),
            "");
}

/// A camera that answers with a playlist of a local file, with the address's format unknown.
TEST(FfmpegPermissions, APlaylistFromACameraReadsNoLocalFile) {
  const testing::TestFolder folder;
  const auto movie = folder.path() / "secret.mjpeg";
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  std::ofstream out(movie, std::ios::binary);
  for (int i = 0; i < 5; ++i) {
    out.write(reinterpret_cast<const char*>(jpeg.data()),
              static_cast<std::streamsize>(jpeg.size()));
  }
  out.close();
  const std::string playlist = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nfile://" +
                               movie.string() + "\n#EXT-X-ENDLIST\n";
  for (const std::string protocol : {"tcp", "http"}) {
    const testing::TestServer server([&](const testing::TestConnection& client) {
      if (protocol == "http") {
        client.request();
        client.send("HTTP/1.0 200 OK\r\nContent-Type: application/vnd.apple.mpegurl\r\n\r\n");
      }
      client.send(playlist);
    });
    EXPECT_NE(refusal({.url = server.url(protocol)}), "") << protocol;
  }
}

TEST(FfmpegPermissions, RedirectionsToOtherHostsAreRefused) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  const testing::TestServer other([&](const testing::TestConnection& client) {
    client.request();
    client.send("HTTP/1.0 200 OK\r\nContent-Type: image/jpeg\r\n\r\n");
    client.send(jpeg);
  });
  std::string elsewhere = other.url("http");
  const std::size_t host = elsewhere.find("127.0.0.1");
  elsewhere.replace(host, 9, "localhost");
  const auto redirect = [&](const std::string& to) {
    return [to](const testing::TestConnection& client) {
      client.request();
      client.send("HTTP/1.0 302 Found\r\nLocation: " + to + "\r\n\r\n");
    };
  };
  {
    const testing::TestServer server(redirect(elsewhere));
    EXPECT_THAT(refusal({.url = server.url("http")}), HasSubstr("redirects to another host"));
  }
  const testing::TestServer server(redirect(other.url("http")));
  EXPECT_TRUE(have_same_host(server.url("http"), other.url("http"))) << "another port";
  EXPECT_TRUE(have_same_host("rtsp://a:b@HOST/x", "http://host:80/y"));
  EXPECT_FALSE(have_same_host("http://host/", "http://host.evil/"));
  EXPECT_FALSE(have_same_host("http://host/", "http://host@evil/"));
  EXPECT_TRUE(have_same_host("http://[::1]:80/", "http://[::1]/"));
}

std::size_t resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t total = 0, resident = 0;
  statm >> total >> resident;
  return resident * 4096;
}

/// Sends a frame, 120 MB of one that does not end, and whole frames.
template <class Send>
void send_frame_that_never_ends(const std::vector<std::byte>& jpeg, const Send& send) {
  send(jpeg);
  std::vector<std::byte> part{std::byte{0xFF}, std::byte{0xD8}};
  send(part);
  part.assign(1 << 20, std::byte{});
  for (int i = 0; i < 120; ++i) send(part);
  for (int i = 0; i < 20; ++i) send(jpeg);
}

/// Expects that the frame that never ends is dropped without being kept.
void expect_frames_around(const std::vector<std::byte>& jpeg, Source source) {
  source.max_frame_mb = 2;
  const auto opened = open_ffmpeg_source(source, "/");
  SourceFrame frame;
  const std::size_t before = resident_bytes();
  int torn = 0, whole = 0;
  std::size_t most = before;
  while (whole < 5 && torn < 200) {
    ASSERT_EQ(opened->next(frame, 20s), Outcome::kFrame);
    most = std::max(most, resident_bytes());
    if (!frame.torn && frame.jpeg == jpeg) {
      ++whole;
    } else {
      ++torn;
    }
  }
  EXPECT_EQ(whole, 5);
  EXPECT_GT(torn, 5);
  EXPECT_LT(most - before, std::size_t{60} << 20) << "of 120 MB";
}

TEST(FfmpegPermissions, AFrameThatNeverEndsIsDroppedAndTheNextOneIsWhole) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  const testing::TestServer server(
      [&](const testing::TestConnection& client) {
        send_frame_that_never_ends(jpeg, [&](const auto& bytes) { client.send(bytes); });
        client.wait_for_end();
      },
      2);
  expect_frames_around(jpeg, {.url = server.url("tcp"), .format = "mjpeg"});
  expect_frames_around(jpeg, {.url = server.url("tcp")});  // FFmpeg finds the format
}

TEST(FfmpegPermissions, AFrameThatNeverEndsOverHttpIsDropped) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  const testing::TestServer server(
      [&](const testing::TestConnection& client) {
        client.request();
        client.send(
            std::string_view("HTTP/1.0 200 OK\r\nContent-Type: video/x-motion-jpeg\r\n\r\n"));
        send_frame_that_never_ends(jpeg, [&](const auto& bytes) { client.send(bytes); });
        client.wait_for_end();
      },
      2);
  expect_frames_around(jpeg, {.url = server.url("http"), .format = "mjpeg"});
  expect_frames_around(jpeg, {.url = server.url("http")});
}

TEST(FfmpegPermissions, APartOfAMultipartStreamThatNeverEndsIsDropped) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  const testing::TestServer server([&](const testing::TestConnection& client) {
    client.request();
    client.send(
        std::string_view("HTTP/1.0 200 OK\r\nContent-Type: "
                         "multipart/x-mixed-replace;boundary=frame\r\n\r\n--frame\r\n"));
    const auto send_part = [&](const auto& bytes) {
      client.send(std::string_view("Content-Type: image/jpeg\r\n\r\n"));
      client.send(bytes);
      client.send(std::string_view("\r\n--frame\r\n"));
    };
    send_part(jpeg);
    client.send(std::string_view("Content-Type: image/jpeg\r\n\r\n\xFF\xD8"));
    const std::vector<std::byte> zeros(1 << 20);
    for (int i = 0; i < 120; ++i) client.send(zeros);
    client.send(std::string_view("\r\n--frame\r\n"));
    for (int i = 0; i < 20; ++i) send_part(jpeg);
    client.wait_for_end();
  });
  expect_frames_around(jpeg, {.url = server.url("http")});
}

// Of an unknown format, size and limit: the frames before it count, and the memory is as stated.
TEST(FfmpegPermissions, AFrameThatNeverEndsTakesTheMemoryThatIsStated) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  const testing::TestServer server([&](const testing::TestConnection& client) {
    for (int i = 0; i < 5; ++i) client.send(jpeg);
    client.send(std::span(jpeg).first(jpeg.size() - 2));
    const std::vector<std::byte> zeros(1 << 20);
    while (client.send(zeros)) {
    }
  });
  const std::size_t before = resident_bytes();
  const auto opened = open_ffmpeg_source({.url = server.url("tcp")}, "/");
  const std::size_t stated = opened->memory_overhead();
  EXPECT_LT(stated, 30'000'000U);
  EXPECT_LE(stated, memory_overhead_before_opening({.url = server.url("tcp")}) + 1'000'000);
  SourceFrame frame;
  int whole = 0, torn = 0;
  std::size_t most = 0;
  while (torn < 10) {
    ASSERT_EQ(opened->next(frame, 20s), Outcome::kFrame);
    ++(frame.torn ? torn : whole);
    most = std::max(most, resident_bytes());
  }
  EXPECT_EQ(whole, 5);
  EXPECT_LT(most, before + stated);
}

TEST(FfmpegPermissions, ASenderThatNeverPausesDoesNotHoldUpTheEnd) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  const testing::TestServer server([&](const testing::TestConnection& client) {
    client.request();
    client.send(std::string_view("HTTP/1.0 200 OK\r\n\r\n"));
    client.send(jpeg);
    client.send(std::string_view("\xFF\xD8", 2));
    const std::string zeros(1 << 20, '\0');
    while (client.send(zeros)) {
    }
  });
  Source source{.url = server.url("http"), .format = "mjpeg"};
  auto opened = open_ffmpeg_source(source, "/");
  SourceFrame frame;
  EXPECT_EQ(opened->next(frame, 10s), Outcome::kFrame);
  const auto start = std::chrono::steady_clock::now();
  opened.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - start, 10s);
}

TEST(FfmpegPermissions, AFrameThatNeverEndsInAPipeIsDropped) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  const testing::TestFolder folder;
  const std::string pipe = (folder.path() / "pipe").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::signal(SIGPIPE, SIG_IGN);  // if it is closed early
  std::thread sender([&] {
    std::ofstream file(pipe, std::ios::binary);
    send_frame_that_never_ends(jpeg, [&](const auto& bytes) {
      file.write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
    });
  });
  expect_frames_around(jpeg, {.url = pipe, .format = "mjpeg"});
  sender.join();
}

}  // namespace
}  // namespace raystage::ingest
