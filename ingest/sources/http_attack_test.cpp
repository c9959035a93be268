// SPDX-License-Identifier: Apache-2.0
// Tests cameras and servers of http that attack the recorder, and such that fail.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <future>

#include "base/error.h"
#include "ingest/sources/ffmpeg_source.h"
#include "testing/ingest/test_pictures.h"
#include "testing/ingest/test_server.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using AttackClock = std::chrono::steady_clock;
using Outcome = FrameSource::Outcome;
using Talk = std::function<void(const testing::TestConnection&)>;

struct Refusal {
  std::string text;
  ExitCode code = ExitCode::kSuccess;
  AttackClock::duration after{};
};

Refusal refused_camera(const std::string& url,
                       const std::map<std::string, std::string>& options = {}) {
  const auto start = AttackClock::now();
  try {
    open_ffmpeg_source({.url = url, .format = "", .options = options, .realtime = false}, "/");
    return {};
  } catch (const Error& error) {
    return {error.what(), error.exit_code(), AttackClock::now() - start};
  }
}

Refusal refused_talk(const Talk& talk, const std::map<std::string, std::string>& options = {}) {
  const testing::TestServer server(
      [&](const testing::TestConnection& client) {
        client.request();
        talk(client);
      },
      testing::TestServer::kEveryClient);
  return refused_camera(server.url("http"), options);
}

TEST(HttpAttack, NoRequestGoesToTheHostThatACameraRedirectsTo) {
  const testing::TestServer internal(
      [](const testing::TestConnection& client) { client.request(); },
      testing::TestServer::kEveryClient, "127.0.0.2");
  const testing::TestServer by_name([](const testing::TestConnection& client) { client.request(); },
                                    testing::TestServer::kEveryClient);
  const std::string numbered = internal.url("http");
  for (const std::string& location :
       {numbered + "/admin?reset", numbered.substr(5), "http://127.0.0.1@" + numbered.substr(7),
        fmt::format("http://localhost:{}/", by_name.port()),
        fmt::format("https://127.0.0.2:{}/", internal.port())}) {
    for (const int status : {301, 302, 303, 307, 308}) {
      const Refusal refusal = refused_talk([&](const testing::TestConnection& client) {
        client.send(fmt::format("HTTP/1.1 {} Moved\r\nLocation: {}\r\nRefresh: 0;url={}\r\n\r\n",
                                status, location, location));
      });
      EXPECT_THAT(refusal.text, HasSubstr("redirects to another host")) << location;
      EXPECT_EQ(refusal.code, ExitCode::kBadInput);
    }
  }
  // Also after a redirection on the host itself, and after a password was asked for.
  int step = 0;
  const Refusal later = refused_talk([&](const testing::TestConnection& client) {
    const std::string target = step++ == 0 ? "/next" : numbered;
    client.send("HTTP/1.1 302 Found\r\nLocation: " + target +
                "\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
  });
  EXPECT_THAT(later.text, HasSubstr("redirects to another host"));
  EXPECT_EQ(step, 2);
  EXPECT_EQ(internal.connections(), 0);
  EXPECT_EQ(by_name.connections(), 0);
}

TEST(HttpAttack, OtherProtocolsAndCirclesAreRefused) {
  for (const char* location : {"file:///etc/passwd", "ftp://127.0.0.1/", "gopher://127.0.0.1:1/x",
                               "tcp://127.0.0.1:1", "dict://127.0.0.1/", "http://"}) {
    EXPECT_THAT(refused_talk([&](const testing::TestConnection& client) {
                  client.send(fmt::format("HTTP/1.1 302 Found\r\nLocation: {}\r\n\r\n", location));
                }).text,
                HasSubstr("the camera redirects"))
        << location;
  }
  EXPECT_THAT(refused_talk([](const testing::TestConnection& client) {
                client.send("HTTP/1.1 302 Found\r\n\r\n");
              }).text,
              HasSubstr("without an address"));
  std::atomic<int> requests = 0;
  EXPECT_THAT(refused_talk([&](const testing::TestConnection& client) {
                ++requests;
                client.send(
                    "HTTP/1.1 302 Found\r\nLocation: /again\r\nContent-Length: 0\r\n"
                    "Connection: close\r\n\r\n");
              }).text,
              HasSubstr("more than 8 times"));
  EXPECT_EQ(requests, 9);
  EXPECT_THAT(refused_talk(
                  [&](const testing::TestConnection& client) {
                    client.send("HTTP/1.1 302 Found\r\nLocation: /again\r\n\r\n");
                  },
                  {{"max_redirects", "0"}})
                  .text,
              HasSubstr("more than 0 times"));
}

TEST(HttpAttack, HeadersThatDoNotEndAreRefused) {
  const auto repeat = [](std::string_view start, std::string_view more) {
    return [=](const testing::TestConnection& client) {
      client.send(start);
      std::string many;
      while (many.size() < 100'000) many += more;
      for (int i = 0; i < 100; ++i) client.send(many);
    };
  };
  for (const Refusal& refusal :
       {refused_talk(repeat("HTTP/1.1 200 OK\r\n", "X: y\r\n")),
        refused_talk(repeat("HTTP/1.1 200 OK\r\nX: ", "yyyyyyyy")),
        refused_talk(repeat("HTTP/1.1 200 OK\r\n", "Set-Cookie: a=b\r\n")),
        refused_talk(repeat("", "HTTP/1.1 100 Continue\r\n\r\n")),
        refused_talk(repeat("", "HTTP/1.1 103 Hints\r\nLocation: http://127.0.0.2/\r\n\r\n")),
        refused_talk(repeat("", "no http at all ")), refused_talk(repeat("\r\n\r\n", "\r\n"))}) {
    EXPECT_EQ(refusal.code, ExitCode::kBadInput) << refusal.text;
    EXPECT_LT(refusal.after, 5s) << refusal.text;
  }
}

TEST(HttpAttack, AServerThatAsksForPasswordsForeverIsLeft) {
  const testing::TestServer server(
      [](const testing::TestConnection& client) {
        while (!client.request().empty()) {
          client.send(
              "HTTP/1.1 401 No\r\nWWW-Authenticate: Digest realm=\"x\", nonce=\"n\", stale=true, "
              "qop=\"auth\"\r\nContent-Length: 0\r\n\r\n");
        }
      },
      testing::TestServer::kEveryClient);
  std::string url = server.url("http");
  url.insert(7, "me:secret@");
  EXPECT_EQ(refused_camera(url).code, ExitCode::kBadInput);
}

TEST(HttpAttack, CompressedAnswersAreRefused) {
  for (const char* header :
       {"Content-Encoding: gzip", "Content-Encoding: br", "Transfer-Encoding: gzip, chunked",
        "Content-Encoding: identity\r\nContent-Encoding: deflate",
        "Transfer-Encoding: gzip\r\nTransfer-Encoding: chunked"}) {
    const Refusal refusal = refused_talk([&](const testing::TestConnection& client) {
      client.send(fmt::format("HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\n{}\r\n\r\n", header));
      client.send(testing::test_jpeg(64, 48, 40));
    });
    EXPECT_THAT(refusal.text, HasSubstr("compresses its data")) << header;
  }
}

/// A server that stops at one stage, or sends a byte of it every 50 ms.
TEST(HttpAttack, AStallAtAnyStageOfTheStartEndsInTime) {
  const std::vector<std::string> stages{
      "",
      "HTT",
      "HTTP/1.1 200 OK\r\nContent-",
      "HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\n\r\n",
      "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n",
      "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n8",
      "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n8\r\nab",
      "HTTP/1.1 302 Found\r\nLocation: /",
  };
  std::vector<std::future<Refusal>> refusals;
  for (const std::string& stage : stages) {
    const Talk stall = [stage](const testing::TestConnection& client) {
      client.send(stage);
      client.wait_for_end();
    };
    refusals.push_back(std::async(std::launch::async, [stall] { return refused_talk(stall); }));
    refusals.push_back(std::async(std::launch::async, [stall] {
      return refused_talk(stall, {{"timeout", "400000"}});
    }));
  }
  for (const char* drip : {"X", "X: y\r\n"}) {
    refusals.push_back(std::async(std::launch::async, [drip] {
      return refused_talk([drip](const testing::TestConnection& client) {
        client.send("HTTP/1.1 200 OK\r\n");
        for (int i = 0; i < 400 && client.send(drip); ++i) {
          std::this_thread::sleep_for(50ms);
        }
      });
    }));
  }
  for (std::size_t i = 0; i < refusals.size(); ++i) {
    const Refusal refusal = refusals[i].get();
    EXPECT_EQ(refusal.code, ExitCode::kFailed) << i << refusal.text;
    EXPECT_LT(refusal.after, i % 2 == 1 && i < 2 * stages.size() ? 5s : 14s) << i << refusal.text;
  }
}

TEST(HttpAttack, AServerThatClosesOrCountsWronglyLosesNoWholeFrame) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  std::string part = "--frame\r\nContent-Type: image/jpeg\r\n";
  part += fmt::format("Content-Length: {}\r\n\r\n", jpeg.size());
  part.append(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  part += "\r\n";
  const std::string multipart = "Content-Type: multipart/x-mixed-replace;boundary=frame\r\n";
  for (const std::string& more :
       {std::string("\r\n"), std::string("Content-Length: 99999999\r\n\r\n"),
        fmt::format("Content-Length: {}\r\n\r\n", 3 * part.size() + 13),
        std::string("Transfer-Encoding: chunked\r\n\r\nffffff\r\n"),
        std::string("Content-Length: 99999999999999999999999\r\n\r\n")}) {
    const testing::TestServer server([&](const testing::TestConnection& client) {
      client.request();
      client.send("HTTP/1.1 200 OK\r\n" + multipart + more);
      client.send(part + part + part + "--frame\r\n");
    });
    const auto source = open_ffmpeg_source({.url = server.url("http"), .format = "mpjpeg"}, "/");
    SourceFrame frame;
    for (int i = 0; i < 3; ++i) {
      ASSERT_EQ(source->next(frame, 5s), Outcome::kFrame) << more;
      EXPECT_EQ(frame.jpeg, jpeg);
    }
    Outcome last = Outcome::kFrame;
    while ((last = source->next(frame, 5s)) == Outcome::kFrame) {
    }
    EXPECT_EQ(last, Outcome::kLost) << more;
    EXPECT_FALSE(source->loss_reason().empty());
  }
  for (const char* start : {"", "HTTP/1.1 2", "HTTP/1.1 200 OK\r\nX", "HTTP/1.1 404 None\r\n\r\n",
                            "HTTP/1.1 99999999999999999 X\r\n\r\n", "HTTP/9.9 200 OK\r\n\r\n"}) {
    EXPECT_NE(refused_talk([&](const testing::TestConnection& client) { client.send(start); }).text,
              "")
        << start;
  }
}

TEST(HttpAttack, AServerOfRangesThatLiesIsRefused) {
  const Refusal refusal = refused_talk([](const testing::TestConnection& client) {
    client.send("HTTP/1.1 206 Part\r\nContent-Range: bytes 500-999/1000\r\n\r\n");
  });
  EXPECT_THAT(refusal.text, HasSubstr("another part"));
}

TEST(HttpAttack, AServerFasterThanTheRecorderWaits) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  std::atomic<std::size_t> sent = 0;
  const testing::TestServer server([&](const testing::TestConnection& client) {
    client.request();
    client.send("HTTP/1.1 200 OK\r\nContent-Type: video/x-motion-jpeg\r\n\r\n");
    while (client.send(jpeg)) sent += jpeg.size();
  });
  const auto source = open_ffmpeg_source({.url = server.url("http"), .format = "mjpeg"}, "/");
  std::size_t before = 1;
  for (int i = 0; i < 100 && before != sent; ++i) {
    before = sent;
    std::this_thread::sleep_for(100ms);
  }
  EXPECT_EQ(before, sent) << "the server still sends";
  EXPECT_LT(sent, std::size_t{32} << 20) << "buffers of the kernel";
  SourceFrame frame;
  for (int i = 0; i < 2000; ++i) {
    ASSERT_EQ(source->next(frame, 5s), Outcome::kFrame);
    ASSERT_EQ(frame.jpeg, jpeg) << i;
  }
}

}  // namespace
}  // namespace raystage::ingest
