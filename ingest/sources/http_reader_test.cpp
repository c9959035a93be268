// SPDX-License-Identifier: Apache-2.0
// Tests cameras and movies behind http and https that mean well. http_attack_test.cpp tests others.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <libavutil/md5.h>
}

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <mutex>

#include "base/error.h"
#include "ingest/sources/ffmpeg_source.h"
#include "testing/ingest/test_movie.h"
#include "testing/ingest/test_pictures.h"
#include "testing/ingest/test_program.h"
#include "testing/ingest/test_server.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;
using Outcome = FrameSource::Outcome;
using HttpSettings = std::map<std::string, std::string>;

std::unique_ptr<FrameSource> open_http(const std::string& url, const HttpSettings& options = {},
                                       const std::string& format = "") {
  return open_ffmpeg_source({.url = url, .format = format, .options = options, .realtime = false},
                            "/");
}

std::string http_refusal(const std::string& url, const HttpSettings& options = {},
                         const std::string& format = "") {
  try {
    open_http(url, options, format);
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

int count_frames(FrameSource& source) {
  SourceFrame frame;
  int frames = 0;
  while (source.next(frame, 5s) == Outcome::kFrame) frames += frame.torn ? 0 : 1;
  return frames;
}

/// Requests that a server received.
class RequestLog {
 public:
  void add(std::string request) {
    const std::scoped_lock lock(mutex_);
    requests_.push_back(std::move(request));
  }
  std::vector<std::string> all() const {
    const std::scoped_lock lock(mutex_);
    return requests_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> requests_;
};

void send_jpeg(const testing::TestConnection& client) {
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  client.send(
      fmt::format("HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n"
                  "Connection: close\r\n\r\n",
                  jpeg.size()));
  client.send(jpeg);
}

void redirect_to(const testing::TestConnection& client, const std::string& location) {
  client.send("HTTP/1.1 302 Found\r\nLocation: " + location +
              "\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
}

TEST(HttpReader, RedirectionsOnTheHostAreFollowed) {
  RequestLog requests;
  const testing::TestServer server(
      [&](const testing::TestConnection& client) {
        const std::string request = client.request();
        requests.add(request);
        if (request.starts_with("GET /live ")) {
          send_jpeg(client);
        } else {
          redirect_to(client, "/live");
        }
      },
      testing::TestServer::kEveryClient);
  std::string url = server.url("http");
  url.insert(7, "me:secret@");
  EXPECT_EQ(count_frames(*open_http(url, {{"headers", "X-Key: 1"}, {"auth_type", "basic"}})), 1);
  ASSERT_EQ(requests.all().size(), 2u);
  EXPECT_THAT(requests.all()[1], HasSubstr("Authorization: Basic bWU6c2VjcmV0\r\n"));
  EXPECT_THAT(requests.all()[1], HasSubstr("X-Key: 1\r\n"));
}

TEST(HttpReader, AllowedRedirectionsToOtherHostsGetNoSecrets) {
  RequestLog first, second;
  const testing::TestServer other(
      [&](const testing::TestConnection& client) {
        second.add(client.request());
        send_jpeg(client);
      },
      1, "127.0.0.2");
  const testing::TestServer server([&](const testing::TestConnection& client) {
    first.add(client.request());
    client.send("HTTP/1.1 301 Moved\r\nLocation: " + other.url("http") +
                "/x\r\nSet-Cookie: session=7\r\nContent-Length: 0\r\n\r\n");
  });
  std::string url = server.url("http");
  url.insert(7, "me:secret@");
  const auto source = open_http(url, {{"protocol_whitelist", "http,tcp"},
                                      {"headers", "X-Key: 1\r\nX-Other: 2\r\n"},
                                      {"auth_type", "basic"},
                                      {"referer", "http://studio/"},
                                      {"user_agent", "stage 5"},
                                      {"cookies", "key=9; path=/\nword=3"}});
  EXPECT_EQ(count_frames(*source), 1);
  for (const char* sent :
       {"Authorization: Basic", "X-Key: 1\r\n", "X-Other: 2\r\n", "key=9", "word=3",
        "Referer: http://studio/", "User-Agent: stage 5\r\n", "Range: bytes=0-\r\n"}) {
    EXPECT_THAT(first.all().at(0), HasSubstr(sent));
  }
  EXPECT_THAT(first.all().at(0), Not(HasSubstr("Accept-Encoding")));
  EXPECT_THAT(second.all().at(0), HasSubstr("GET /x HTTP/1.1"));
  EXPECT_THAT(second.all().at(0), HasSubstr("User-Agent: stage 5\r\n"));
  for (const char* secret : {"Authorization", "X-Key", "X-Other", "Cookie", "Referer"}) {
    EXPECT_THAT(second.all().at(0), Not(HasSubstr(secret)));
  }
}

std::string md5(const std::string& text) {
  std::array<std::uint8_t, 16> sum{};
  av_md5_sum(sum.data(), reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
  std::string digits;
  for (const std::uint8_t byte : sum) digits += fmt::format("{:02x}", byte);
  return digits;
}

std::string field(const std::string& request, const std::string& name) {
  std::size_t at = request.find(name + "=");
  if (at == request.npos) return "";
  at += name.size() + 1;
  if (request[at] == '"') return request.substr(at + 1, request.find('"', at + 1) - at - 1);
  return request.substr(at, request.find_first_of(",\r", at) - at);
}

TEST(HttpReader, DigestAndBasicPasswordsAreAnswered) {
  for (const std::string scheme : {"Digest", "Basic"}) {
    bool right = false;
    const testing::TestServer server(
        [&](const testing::TestConnection& client) {
          std::string request = client.request();
          if (request.find("Authorization: ") == request.npos) {
            client.send(scheme == "Basic"
                            ? "HTTP/1.1 401 No\r\nWWW-Authenticate: Basic realm=\"cameras\"\r\n"
                              "Content-Length: 2\r\nConnection: close\r\n\r\nno"
                            : "HTTP/1.1 401 No\r\nWWW-Authenticate: Digest realm=\"cameras\", "
                              "nonce=\"n0\", qop=\"auth\"\r\nContent-Length: 0\r\n"
                              "Connection: close\r\n\r\n");
            return;
          }
          if (scheme == "Basic") {
            right = request.find("Authorization: Basic bWU6czpAdA==") != request.npos;
          } else {
            const std::string answer =
                md5(md5("me:cameras:s:@t") + ":n0:" + field(request, "nc") + ":" +
                    field(request, "cnonce") + ":auth:" + md5("GET:/live?a=b"));
            right = field(request, "response") == answer;
          }
          send_jpeg(client);
        },
        testing::TestServer::kEveryClient);
    std::string url = server.url("http") + "/live?a=b";
    url.insert(7, "me:s:%40t@");
    EXPECT_EQ(count_frames(*open_http(url)), 1) << scheme;
    EXPECT_TRUE(right) << scheme;
    EXPECT_EQ(server.connections(), 2);
  }
  const testing::TestServer closed([](const testing::TestConnection& client) {
    client.request();
    client.send(
        "HTTP/1.1 401 No\r\nWWW-Authenticate: Basic realm=\"x\"\r\nContent-Length: 0\r\n\r\n");
  });
  EXPECT_THAT(http_refusal(closed.url("http")), HasSubstr("answers 401. Check the user name"));
}

TEST(HttpReader, EveryFrameOfChunkedMultipartIsRead) {
  constexpr int kFrames = 40;
  std::string body;
  std::vector<std::vector<std::byte>> given;
  for (int i = 0; i < kFrames; ++i) {
    given.push_back(testing::test_jpeg(64, 48, 20 + 5 * i));
    body += "--limit\r\nContent-Type: image/jpeg\r\n\r\n";
    body.append(reinterpret_cast<const char*>(given.back().data()), given.back().size());
    body += "\r\n";
  }
  body += "--limit\r\n\r\n";
  // FFmpeg needs the boundary from the MIME type if it must not take any dashes for one.
  for (const HttpSettings& options : {HttpSettings{}, {{"strict_mime_boundary", "1"}}}) {
    const testing::TestServer server([&](const testing::TestConnection& client) {
      client.request();
      client.send(
          "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=limit\r\n"
          "Transfer-Encoding: chunked\r\n\r\n");
      for (std::size_t at = 0, piece = 1; at < body.size(); at += piece, piece = piece * 7 % 4093) {
        const std::string part = body.substr(at, piece);
        client.send(fmt::format("{:x};note=1\r\n{}\r\n", part.size(), part));
      }
      client.send("0\r\nTrailer: 1\r\n\r\n");
    });
    const auto source = open_http(server.url("http"), options);
    SourceFrame frame;
    for (const auto& jpeg : given) {
      ASSERT_EQ(source->next(frame, 5s), Outcome::kFrame);
      EXPECT_EQ(frame.jpeg, jpeg);
    }
  }
}

/// Serves a file with ranges, or without.
auto file_server(const std::filesystem::path& file, bool ranges, RequestLog& requests) {
  std::ifstream in(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  return [bytes, ranges, &requests](const testing::TestConnection& client) {
    const std::string request = client.request();
    requests.add(request);
    std::size_t from = 0;
    const std::size_t range = request.find("Range: bytes=");
    if (ranges && range != request.npos) {
      std::from_chars(request.data() + range + 13, request.data() + request.size(), from);
      client.send(fmt::format("HTTP/1.1 206 Partial\r\nContent-Range: bytes {}-{}/{}\r\n", from,
                              bytes.size() - 1, bytes.size()));
    } else {
      client.send("HTTP/1.1 200 OK\r\n");
    }
    client.send(
        fmt::format("Content-Type: video/any\r\nContent-Length: {}\r\n\r\n", bytes.size() - from));
    client.send(std::string_view(bytes).substr(from));
  };
}

TEST(HttpReader, AMovieWithItsIndexAtTheEndIsReadByRanges) {
  const testing::TestFolder folder;
  const auto movie = folder.path() / "movie.mov";
  testing::write_movie(movie, {.width = 64, .height = 48, .frames = 4000});
  ASSERT_GT(std::filesystem::file_size(movie), 150'000u);
  {
    RequestLog requests;
    const testing::TestServer server(file_server(movie, true, requests),
                                     testing::TestServer::kEveryClient);
    const auto source = open_http(server.url("http"));
    EXPECT_FALSE(source->description().live);
    EXPECT_EQ(count_frames(*source), 3999) << "as from a file: the last has no duration";
    EXPECT_GE(requests.all().size(), 3u);
  }
  RequestLog requests;
  const testing::TestServer server(file_server(movie, true, requests),
                                   testing::TestServer::kEveryClient);
  EXPECT_EQ(count_frames(*open_http(server.url("http"), {{"seekable", "0"}})), 0);
  EXPECT_THAT(requests.all().at(0), Not(HasSubstr("Range")));
  EXPECT_EQ(requests.all().size(), 1u);
}

TEST(HttpReader, AMovieFromAServerWithoutRangesIsReadFromItsStart) {
  const testing::TestFolder folder;
  const auto movie = folder.path() / "movie.mkv";
  testing::write_movie(movie, {.width = 640, .height = 480, .frames = 50});
  RequestLog requests;
  const testing::TestServer server(file_server(movie, false, requests),
                                   testing::TestServer::kEveryClient);
  EXPECT_EQ(count_frames(*open_http(server.url("http"))), 50);
  EXPECT_EQ(requests.all().size(), 1u);
}

TEST(HttpReader, OptionsThatAreNotSupportedAreNamed) {
  const std::string nowhere = "http://127.0.0.1:1/";
  EXPECT_THAT(http_refusal(nowhere, {{"reconnect", "1"}}),
              HasSubstr("\"reconnect\" of http is not supported"));
  EXPECT_THAT(http_refusal(nowhere, {{"timeout", "soon"}}), HasSubstr("\"timeout\""));
  EXPECT_THAT(http_refusal(nowhere, {{"tls_verify", "7"}}), HasSubstr("\"tls_verify\""));
  EXPECT_THAT(http_refusal(nowhere, {{"protocol_whitelist", "https,tls,tcp"}}),
              HasSubstr("lacks \"http\""));
  EXPECT_THAT(http_refusal(nowhere), HasSubstr("Connection refused"));
}

TEST(HttpReader, OnlyTheConfigurationNamesAProxy) {
  RequestLog asked;
  const testing::TestServer proxy([&](const testing::TestConnection& client) {
    asked.add(client.request());
    send_jpeg(client);
  });
  const testing::TestServer server([](const testing::TestConnection& client) {
    client.request();
    send_jpeg(client);
  });
  ::setenv("http_proxy", proxy.url("http").c_str(), 1);
  ::setenv("all_proxy", proxy.url("http").c_str(), 1);
  EXPECT_EQ(count_frames(*open_http(server.url("http"))), 1);
  ::unsetenv("http_proxy");
  ::unsetenv("all_proxy");
  EXPECT_EQ(proxy.connections(), 0);
  EXPECT_EQ(count_frames(*open_http("http://camera.invalid/", {{"http_proxy", proxy.url("http")}})),
            1);
  EXPECT_THAT(asked.all().at(0), HasSubstr("GET http://camera.invalid/ "));
}

int free_tls_port() {
  const testing::TestServer server([](const testing::TestConnection&) {});
  return server.port();
}

TEST(HttpReader, CertificatesAreCheckedIfTheConfigurationSaysSo) {
  if (std::system("openssl version > /dev/null 2>&1") != 0) GTEST_SKIP() << "there is no openssl";
  const testing::TestFolder folder;
  const std::string at = folder.path().string();
  ASSERT_EQ(
      std::system(fmt::format("cd {} && openssl req -x509 -newkey rsa:2048 -nodes -keyout key "
                              "-out cert -days 2 -subj /CN=localhost -addext "
                              "subjectAltName=DNS:localhost > /dev/null 2>&1",
                              at)
                      .c_str()),
      0);
  const auto jpeg = testing::test_jpeg(64, 48, 40);
  std::ofstream picture(folder.path() / "live", std::ios::binary);
  picture << "HTTP/1.0 200 OK\r\nContent-Type: image/jpeg\r\n\r\n";
  picture.write(reinterpret_cast<const char*>(jpeg.data()), std::ssize(jpeg));
  picture.close();
  const int port = free_tls_port();
  std::ofstream(folder.path() / "down")
      << "HTTP/1.0 302 Found\r\nLocation: http://localhost:" << port << "/live\r\n\r\n";
  const testing::TestProgram server(fmt::format(
      "cd {} && exec openssl s_server -quiet -HTTP -accept {} -cert cert -key key > /dev/null 2>&1",
      at, port));
  const std::string url = fmt::format("https://localhost:{}/", port);
  std::string first;
  for (int i = 0; i < 50; ++i) {
    first = http_refusal(url + "live");
    if (first.find("Connection refused") == first.npos) break;
    std::this_thread::sleep_for(100ms);
  }
  EXPECT_EQ(first, "");
  EXPECT_THAT(http_refusal(url + "live", {{"tls_verify", "1"}}), HasSubstr("certificate"));
  const HttpSettings verified{{"tls_verify", "1"}, {"ca_file", at + "/cert"}};
  EXPECT_EQ(http_refusal(url + "live", verified), "");
  EXPECT_THAT(http_refusal(fmt::format("https://127.0.0.1:{}/live", port), verified),
              HasSubstr("127.0.0.1"));
  EXPECT_THAT(http_refusal(url + "down"), HasSubstr("from https to http"));
}

}  // namespace
}  // namespace raystage::ingest
