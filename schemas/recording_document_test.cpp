// SPDX-License-Identifier: Apache-2.0
#include "schemas/recording_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "base/error.h"

namespace raystage::schemas {
namespace {

RecordingDocument example() {
  RecordingDocument recording;
  recording.node = "node1";
  RecordingDocument::Session session;
  session.program = "raystage 0.1.0";
  session.started_utc = 1'767'225'600'123'456'789;
  session.memory_bytes = 1'000'000'000;
  session.held = true;
  session.clock = {"chrony", -0.000012, 0.0005};
  session.cameras.push_back({"a",
                             "ffmpeg v4l2:/dev/video0",
                             "device",
                             "exposure_middle",
                             100,
                             90,
                             {{"torn", 4}, {"dropped, memory full", 6}},
                             3,
                             1,
                             {{1'767'225'601'000'000'000, "lost: no frame for 5.0 s"}}});
  session.cameras.push_back({"b", "simulated", "simulated", "unknown", 0, 0, {}, 0, 0, {}});
  recording.sessions.push_back(session);  // killed
  session.stopped_utc = session.started_utc + 5'000'000'000;
  session.stop_reason = "SIGINT";
  session.memory_peak_bytes = 77;
  session.clock = {};
  session.audit =
      RecordingDocument::AuditResult{false, {"camera a: 100 arrived, 99 accounted for"}};
  recording.sessions.push_back(session);
  return recording;
}

TEST(RecordingDocument, ComesBackTheSame) {
  const std::string text = format_recording(example());
  const RecordingDocument back = parse_recording(text, "x");
  EXPECT_EQ(format_recording(back), text);
  ASSERT_EQ(back.sessions.size(), 2U);
  EXPECT_FALSE(back.sessions[0].stopped_utc);
  EXPECT_FALSE(back.sessions[0].audit);
  EXPECT_EQ(back.sessions[0].started_utc, 1'767'225'600'123'456'789);
  EXPECT_EQ(*back.sessions[0].clock.offset_s, -0.000012);
  EXPECT_EQ(back.sessions[1].cameras[0].dropped.at("dropped, memory full"), 6U);
  EXPECT_EQ(back.sessions[1].cameras[0].events[0].what, "lost: no frame for 5.0 s");
  EXPECT_FALSE(back.sessions[1].audit->holds);
  EXPECT_EQ(back.sessions[1].clock.source, "unknown");
}

TEST(RecordingDocument, SaysWhoCameTooLate) {
  RecordingDocument recording = example();
  EXPECT_EQ(parse_recording(format_recording(recording), "x").sessions[0].late(), 0);  // older ones
  RecordingDocument::Session& session = recording.sessions[0];
  session.start_at_utc = session.started_utc - 2'500'000'000;
  EXPECT_EQ(parse_recording(format_recording(recording), "x").sessions[0].late(), 2'500'000'000);
  session.start_at_utc = std::numeric_limits<Nanoseconds>::min();  // 1677
  EXPECT_EQ(parse_recording(format_recording(recording), "x").sessions[0].late(),
            std::numeric_limits<Nanoseconds>::max());
  session.start_at_utc = session.started_utc + 1;
  EXPECT_EQ(parse_recording(format_recording(recording), "x").sessions[0].late(), 0);
}

TEST(RecordingDocument, RefusesWhatIsWrong) {
  const std::string text = format_recording(example());
  for (const auto& [from, to] :
       {std::pair("\"chrony\"", "\"sundial\""), std::pair("\"id\": \"b\"", "\"id\": \"a\""),
        std::pair("\"arrived\": 100", "\"arrived\": -1"),
        std::pair("recording/1", "recording/2")}) {
    std::string wrong = text;
    wrong.replace(wrong.find(from), std::string(from).size(), to);
    EXPECT_THROW(parse_recording(wrong, "x"), Error) << to;
  }
}

}  // namespace
}  // namespace raystage::schemas
