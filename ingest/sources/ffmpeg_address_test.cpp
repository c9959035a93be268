// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/ffmpeg_address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>

#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using Kind = FfmpegAddress::Kind;

FfmpegAddress address(const std::string& url, const std::string& format = "",
                      const std::filesystem::path& base = "/base") {
  return resolve_ffmpeg_address({.url = url, .format = format, .options = {}, .realtime = false},
                                base);
}

TEST(FfmpegAddress, FilesAreRelativeToTheConfig) {
  EXPECT_EQ(address("a/b.mkv").url, "file:/base/a/b.mkv");
  EXPECT_EQ(address("/a/b.mkv").url, "file:/a/b.mkv");
  EXPECT_EQ(address("file:b.mkv").url, "file:/base/b.mkv");
  EXPECT_EQ(address("%04d.jpg").kind, Kind::kFile);
}

TEST(FfmpegAddress, KindsAreToldApart) {
  EXPECT_EQ(address("http://10.0.0.1/video").kind, Kind::kNetwork);
  EXPECT_EQ(address("tcp://10.0.0.1:99", "mjpeg").kind, Kind::kNetwork);
  EXPECT_EQ(address("rtsp://10.0.0.1/stream").kind, Kind::kNetwork);
  EXPECT_EQ(address("rtsp://10.0.0.1/stream").url, "rtsp://10.0.0.1/stream");
  EXPECT_EQ(address("pipe:0", "rawvideo").kind, Kind::kPipe);
  const testing::TestFolder folder;
  ASSERT_EQ(mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(address("pipe", "mjpeg", folder.path()).kind, Kind::kPipe);
}

TEST(FfmpegAddress, AFormatMayStandBeforeTheColon) {
  const FfmpegAddress device = address("v4l2:/dev/video0");
  EXPECT_EQ(device.kind, Kind::kDevice);
  EXPECT_EQ(device.url, "/dev/video0");
  EXPECT_THAT(device.format->name, ::testing::HasSubstr("v4l2"));
  EXPECT_EQ(address("/dev/video0", "v4l2").kind, Kind::kDevice);
  EXPECT_EQ(address("mjpeg:a.mjpg").url, "file:/base/a.mjpg");
  EXPECT_THROW(address("nothing:a"), Error);
  EXPECT_THROW(address("a", "nothing"), Error);
}

TEST(FfmpegAddress, AGraphIsACameraWhereItKeepsRealTime) {
  for (const char* graph :
       {"testsrc", "testsrc=rate=30:duration=5", "testsrc=size=64x48,drawtext=text=realtime",
        "movie=realtime.mkv", "testsrc,realtimes=1"}) {
    EXPECT_EQ(address(graph, "lavfi").kind, Kind::kFilterGraph) << graph;
    EXPECT_FALSE(address(graph, "lavfi").is_live()) << graph;
  }
  for (const char* graph : {"testsrc,realtime", "testsrc , realtime=speed=2[out0]",
                            "testsrc[a];[a]realtime@r", "sine,arealtime[out1];testsrc[out0]"}) {
    EXPECT_EQ(address(graph, "lavfi").kind, Kind::kDevice) << graph;
  }
  EXPECT_TRUE(resolve_ffmpeg_address({.url = "lavfi:",
                                      .format = "",
                                      .options = {{"graph", "testsrc,realtime"}},
                                      .realtime = false},
                                     "/base")
                  .is_live());
}

TEST(FfmpegAddress, AColonInAFilesNameIsNoFormat) {
  const testing::TestFolder folder;
  std::ofstream(folder.path() / "take:1.mkv") << "x";
  EXPECT_EQ(address("take:1.mkv", "", folder.path()).url,
            "file:" + (folder.path() / "take:1.mkv").string());
}

TEST(FfmpegAddress, PasswordsAreNotShown) {
  EXPECT_EQ(address("rtsp://me:secret@10.0.0.1/a@b").display_url, "rtsp://10.0.0.1/a@b");
  EXPECT_EQ(address("rtsp://me:secret@10.0.0.1/a@b").url, "rtsp://me:secret@10.0.0.1/a@b");
  EXPECT_EQ(address("rtsp://10.0.0.1").display_url, "rtsp://10.0.0.1");
  EXPECT_EQ(address("http://10.0.0.1/a@b").display_url, "http://10.0.0.1/a@b");
}

}  // namespace
}  // namespace raystage::ingest
