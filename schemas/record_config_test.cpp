// SPDX-License-Identifier: Apache-2.0
#include "schemas/record_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::schemas::record_config_test {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

json full() {
  return json::parse(R"({
    "schema": "raystage/record/1", "name": "rehearsal", "node": "left", "rig": "rig.json",
    "nominal_fps": 29.97, "color_space": "srgb_texture", "memory_mb": 512.5, "buffer_in_memory": true,
    "when_full": "drop_oldest", "when_lost": "reconnect", "lost_after_seconds": 2.5,
    "jpeg": {"quality": 80, "chroma": "422", "restart_interval": 4},
    "cameras": [
      {"id": "a", "ffmpeg": {"url": "v4l2:/dev/video0", "format": "v4l2",
                             "options": {"video_size": "640x480", "input_format": "mjpeg"},
                             "realtime": true}},
      {"id": "b", "aravis": {"device": "s", "exposure_us": 5000.5, "gain": -1.5, "fps": 30.0,
                             "trigger": "Line1", "pixel_format": "BayerRG8", "packet_size": 1400,
                             "buffers": 8, "packet_resend": false, "packet_socket": false,
                             "socket_buffer_bytes": 65536}},
      {"id": "c", "simulated": {"scene": "chart", "seed": 7, "rows": 2, "columns": 3, "index": 5,
                                "width": 64, "height": 48, "fps": 25.0, "seconds": 1.0,
                                "jpeg": true}}]})");
}

json minimal() {
  return json::parse(R"({"schema": "raystage/record/1", "name": "r",
                         "cameras": [{"id": "a", "ffmpeg": {"url": "a.mkv"}}]})");
}

std::string refusal(const json& document) {
  try {
    parse_record_config(document.dump(), "f.json");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_FALSE(error.what_to_do().empty());
    return error.what();
  }
  return "accepted";
}

TEST(RecordConfig, WhatIsWrittenIsWhatWasRead) {
  // The text has exactly the properties of the schema.
  const json document = full();
  EXPECT_EQ(json::parse(format_record_config(parse_record_config(document.dump(), "f"))), document);
}

TEST(RecordConfig, ReadsEveryField) {
  const RecordConfig config = parse_record_config(full().dump(), "f.json");
  EXPECT_EQ(config.when_full, RecordConfig::OverflowPolicy::kDropOldest);
  EXPECT_EQ(config.when_lost, RecordConfig::LostSourcePolicy::kReconnect);
  EXPECT_EQ(config.chroma, RecordConfig::Chroma::k422);
  EXPECT_EQ(config.quality, 80);
  EXPECT_EQ(config.restart_interval, 4);
  ASSERT_EQ(config.cameras.size(), 3U);
  const auto& ffmpeg = std::get<RecordConfig::FfmpegSource>(config.cameras[0].source);
  EXPECT_EQ(ffmpeg.options.at("video_size"), "640x480");
  EXPECT_TRUE(ffmpeg.realtime);
  const auto& aravis = std::get<RecordConfig::AravisSource>(config.cameras[1].source);
  EXPECT_EQ(aravis.exposure_us, 5000.5);
  EXPECT_EQ(aravis.packet_size, 1400);
  EXPECT_FALSE(aravis.packet_socket);
  const auto& simulated = std::get<RecordConfig::SimulatedSource>(config.cameras[2].source);
  EXPECT_EQ(simulated.seed, 7U);
  EXPECT_EQ(simulated.index, 5);
  EXPECT_TRUE(simulated.jpeg);
}

TEST(RecordConfig, WhatIsNotSaidHasItsDefault) {
  const RecordConfig config = parse_record_config(minimal().dump(), "f.json");
  EXPECT_EQ(config.memory_mb, 1024);
  EXPECT_EQ(config.when_full, RecordConfig::OverflowPolicy::kDropNewest);
  EXPECT_EQ(config.when_lost, RecordConfig::LostSourcePolicy::kContinue);
  EXPECT_EQ(config.chroma, RecordConfig::Chroma::k420);
  EXPECT_EQ(config.restart_interval, -1);
  EXPECT_EQ(config.nominal_fps, 0);
  EXPECT_TRUE(config.rig.empty());
  const std::string once = format_record_config(config);
  EXPECT_EQ(format_record_config(parse_record_config(once, "f.json")), once);
}

TEST(RecordConfig, EmptySourcesAreTheDefaultsAndComeBack) {
  json document = minimal();
  document["cameras"] = {{{"id", "a"}, {"aravis", json::object()}},
                         {{"id", "b"}, {"simulated", json::object()}}};
  const RecordConfig config = parse_record_config(document.dump(), "f.json");
  EXPECT_FALSE(std::get<RecordConfig::AravisSource>(config.cameras[0].source).gain);
  EXPECT_EQ(std::get<RecordConfig::SimulatedSource>(config.cameras[1].source).rows, 8);
  const std::string once = format_record_config(config);
  EXPECT_EQ(format_record_config(parse_record_config(once, "f.json")), once);
}

TEST(RecordConfig, IsReadFromAFile) {
  const testing::TestFolder folder;
  write_file_atomically(folder.path() / "record.json", full().dump());
  EXPECT_EQ(read_record_config(folder.path() / "record.json").name, "rehearsal");
  EXPECT_THROW(read_record_config(folder.path() / "missing.json"), Error);
}

TEST(RecordConfig, OtherVersionsAndDocumentsAreRefused) {
  json document = minimal();
  document["schema"] = "raystage/record/2";
  EXPECT_THAT(refusal(document),
              HasSubstr("the file has version 2, but this program reads up to 1"));
  document["schema"] = "raystage/take/1";
  EXPECT_THAT(refusal(document), StartsWith("f.json#/schema: found \"raystage/take/1\""));
}

TEST(RecordConfig, RemarksAreLetPassButNotAmongOptions) {
  json document = minimal();
  document["x_tool"] = 1;
  document["comment"] = "hello";
  document["cameras"][0]["ffmpeg"]["comment"] = "hello";
  EXPECT_EQ(refusal(document), "accepted");
  document["cameras"][0]["ffmpeg"]["options"] = {{"comment", "hello"}};
  const RecordConfig config = parse_record_config(document.dump(), "f.json");
  EXPECT_EQ(std::get<RecordConfig::FfmpegSource>(config.cameras[0].source).options.count("comment"),
            1U);
}

struct Damage {
  const char* pointer;  ///< what is replaced
  json value;
  const char* where;  ///< the pointer in the error
  const char* message;
};

void PrintTo(const Damage& damage, std::ostream* stream) {
  *stream << damage.pointer << " = " << damage.value.dump();
}

class DamagedRecordConfig : public ::testing::TestWithParam<Damage> {};

TEST_P(DamagedRecordConfig, IsRefusedAtThePlace) {
  const Damage& damage = GetParam();
  json document = full();
  document[json::json_pointer(damage.pointer)] = damage.value;
  EXPECT_THAT(refusal(document), AllOf(StartsWith(std::string("f.json#") + damage.where + ":"),
                                       HasSubstr(damage.message)));
}

INSTANTIATE_TEST_SUITE_P(
    Values, DamagedRecordConfig,
    ::testing::Values(
        Damage{"/memory_mb", 0, "/memory_mb", "found 0"},
        Damage{"/buffer_in_memory", "yes", "/buffer_in_memory", "allowed: a boolean"},
        Damage{"/when_full", "block", "/when_full", "\"drop_newest\" or \"drop_oldest\""},
        Damage{"/when_lost", "retry", "/when_lost", "\"continue\" or \"reconnect\" or \"stop\""},
        Damage{"/lost_after_seconds", 0, "/lost_after_seconds", "greater than 0"},
        Damage{"/jpeg/quality", 101, "/jpeg/quality", "from 1 up to 100"},
        Damage{"/jpeg/chroma", "411", "/jpeg/chroma", "\"444\" or \"422\" or \"420\""},
        Damage{"/jpeg/restart_interval", -1, "/jpeg/restart_interval", "found -1"},
        Damage{"/color_space", "lin_rec709_scene", "/color_space", "srgb_texture"},
        Damage{"/nominal_fps", 0, "/nominal_fps", "greater than 0"},
        Damage{"/node", "a\tb", "/node", "control character"},
        Damage{"/rig", "a\nb", "/rig", "control character"},
        Damage{"/fps", 30, "/fps", "unknown property"}));

INSTANTIATE_TEST_SUITE_P(
    Cameras, DamagedRecordConfig,
    ::testing::Values(
        Damage{"/cameras", json::array(), "/cameras", "an array of 1 to 10000"},
        Damage{"/cameras/1/id", "a", "/cameras/1/id", "the id \"a\" is used twice"},
        Damage{"/cameras/1/id", "../a", "/cameras/1/id", "found \"../a\""},
        Damage{"/cameras/1", {{"id", "b"}}, "/cameras/1", "found no source"},
        Damage{"/cameras/1/simulated", json::object(), "/cameras/1", "found several sources"},
        Damage{"/cameras/0/ffmpeg/url", "", "/cameras/0/ffmpeg/url", "found \"\""},
        Damage{"/cameras/0/ffmpeg/url", std::string("a\0b", 3), "/cameras/0/ffmpeg/url",
               "control character"},
        Damage{"/cameras/0/ffmpeg/options/framerate", 30, "/cameras/0/ffmpeg/options/framerate",
               "found 30, allowed: an option's value as text"},
        Damage{"/cameras/0/ffmpeg/options/a~1b", nullptr, "/cameras/0/ffmpeg/options/a~1b",
               "found null"},
        Damage{"/cameras/1/aravis/buffers", 1, "/cameras/1/aravis/buffers", "from 2"},
        Damage{"/cameras/1/aravis/exposure_us", 0, "/cameras/1/aravis/exposure_us",
               "greater than 0"},
        Damage{"/cameras/1/aravis/exposure", 1, "/cameras/1/aravis/exposure", "unknown property"},
        Damage{"/cameras/2/simulated/index", 6, "/cameras/2/simulated/index",
               "found 6, allowed: less than the 6 cameras"},
        Damage{"/cameras/2/simulated/fps", 0, "/cameras/2/simulated/fps", "from 0.1"},
        Damage{"/cameras/2/simulated/seconds", 0, "/cameras/2/simulated/seconds",
               "greater than 0"}));

}  // namespace
}  // namespace raystage::schemas::record_config_test
