// SPDX-License-Identifier: Apache-2.0
#include "tests/attack/hostile_cameras.h"

#include <fmt/format.h>

#include <chrono>
#include <random>
#include <thread>

#include "testing/ingest/test_pictures.h"

namespace raystage::testing {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kPiece = 200'000;  // bytes, every 10 ms: 20 MB/s

/// Sends pieces until the client closes the connection.
void send_forever(const TestConnection& client, const std::function<std::string()>& piece,
                  std::chrono::milliseconds pause = 10ms) {
  while (client.send(piece())) std::this_thread::sleep_for(pause);
}

/// Returns a JPEG whose header states another size.
std::vector<std::byte> jpeg_stating(int width, int height) {
  std::vector<std::byte> jpeg = test_jpeg(64, 48, 90);
  for (std::size_t i = 0; i + 9 < jpeg.size(); ++i) {
    if (jpeg[i] != std::byte{0xFF} || jpeg[i + 1] != std::byte{0xC0}) continue;  // SOF0
    jpeg[i + 5] = static_cast<std::byte>(height >> 8);
    jpeg[i + 6] = static_cast<std::byte>(height);
    jpeg[i + 7] = static_cast<std::byte>(width >> 8);
    jpeg[i + 8] = static_cast<std::byte>(width);
    return jpeg;
  }
  return jpeg;
}

void never_ending_frame(const TestConnection& client) {
  client.send("Content-Type: image/jpeg\r\n\r\n");
  client.send(text_of(test_jpeg(64, 48, 30)).substr(0, 300));
  send_forever(client, [] { return std::string(kPiece, '\0'); });
}

void giant_sizes(const TestConnection& client) {
  const std::vector<std::byte> jpeg = jpeg_stating(65535, 65535);
  for (int i = 0; i < 1000; ++i) {
    send_part(client, jpeg);
    std::this_thread::sleep_for(20ms);
  }
}

void changing_sizes(const TestConnection& client) {
  const std::vector<std::vector<std::byte>> jpegs{test_jpeg(8, 8, 30), test_jpeg(2000, 1600, 60),
                                                  jpeg_stating(1, 65535), jpeg_stating(0, 0),
                                                  jpeg_stating(9000, 7000)};
  for (std::size_t i = 0; i < 500; ++i) {
    send_part(client, jpegs[i % jpegs.size()]);
    std::this_thread::sleep_for(40ms);
  }
}

void torn_frames(const TestConnection& client) {
  std::mt19937 random(5);  // NOLINT: the same in every run
  for (int i = 0; i < 1500; ++i) {
    std::vector<std::byte> jpeg = test_jpeg(96, 64, i % 200);
    if (i % 2 == 0) jpeg.resize(jpeg.size() / 2 + 1);
    for (int damage = 0; damage < 5; ++damage) {
      jpeg[random() % jpeg.size()] = static_cast<std::byte>(random());
    }
    send_part(client, jpeg);
    std::this_thread::sleep_for(10ms);
  }
}

void noise(const TestConnection& client) {
  std::mt19937 random(3);  // NOLINT: the same in every run
  send_forever(client, [&] {
    std::string bytes(kPiece, '\0');
    for (std::size_t i = 0; i < bytes.size(); i += 7) bytes[i] = static_cast<char>(random());
    return bytes;
  });
}

void stall(const TestConnection& client) {
  client.send("Content-Type: image/jpeg\r\nContent-Length: 5000\r\n\r\n");
  client.send(text_of(test_jpeg(64, 48, 30)).substr(0, 100));
  client.wait_for_end();
}

void endless_part_headers(const TestConnection& client) {
  send_forever(client, [] { return "X-Padding: " + std::string(kPiece, 'x'); });
}

}  // namespace

std::string text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

void begin_multipart(const TestConnection& client) {
  client.request();
  client.send(
      "HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=frame\r\n\r\n"
      "--frame\r\n");
}

bool send_part(const TestConnection& client, std::span<const std::byte> jpeg) {
  return client.send(
      fmt::format("Content-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n{}\r\n--frame\r\n",
                  jpeg.size(), text_of(jpeg)));
}

std::vector<HostileCamera> hostile_cameras(const std::string& local_file,
                                           const std::string& other_host) {
  const std::string playlist = fmt::format(
      "#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\nfile://{}\n"
      "#EXTINF:5,\n{}/segment.ts\n",
      local_file, other_host);
  return {
      {"never_ending_frame", "http", "", never_ending_frame},
      {"giant_sizes", "http", "", giant_sizes},
      {"changing_sizes", "http", "", changing_sizes},
      {"torn_frames", "http", "", torn_frames},
      {"noise", "tcp", "mjpeg", noise},
      {"stall", "http", "", stall},
      {"endless_part_headers", "http", "", endless_part_headers},
      {"playlist", "tcp", "", [playlist](const TestConnection& client) { client.send(playlist); }},
      {"redirection", "http", "",
       [other_host](const TestConnection& client) {
         client.request();
         client.send("HTTP/1.1 302 Found\r\nLocation: " + other_host + "/\r\n\r\n");
       },
       true},
      {"hang_up", "http", "", [](const TestConnection& /*client*/) {}},
  };
}

}  // namespace raystage::testing
