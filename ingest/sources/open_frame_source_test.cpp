// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/open_frame_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "ingest/sources/configuration_error.h"
#include "testing/ingest/test_pictures.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;

TEST(OpenFrameSource, OpensEachKindAndNamesTheCameraInErrors) {
  const testing::TestFolder folder;
  write_file_atomically(folder.path() / "a.jpg", testing::test_jpeg(32, 24, 99));
  schemas::RecordConfig::FfmpegSource file;
  file.url = "a.jpg";
  SourceFrame frame;
  EXPECT_EQ(open_frame_source({"a", file}, folder.path())->next(frame, 2000ms),
            FrameSource::Outcome::kFrame);
  EXPECT_EQ(frame.jpeg, testing::test_jpeg(32, 24, 99));

  schemas::RecordConfig::SimulatedSource simulated;
  simulated.rows = simulated.columns = 1;
  simulated.width = simulated.height = 16;
  simulated.seconds = 0.1;
  EXPECT_EQ(open_frame_source({"b", simulated}, folder.path())->description().clock, "simulated");

  file.url = "missing.mkv";
  try {
    open_frame_source({"r0c7", file}, folder.path());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.where(), ::testing::StartsWith("camera \"r0c7\", "));
  }
}

TEST(OpenFrameSource, WrongConfigurationsAreNoFaultsOfCameras) {
  const testing::TestFolder folder;
  write_file_atomically(folder.path() / "a.jpg", testing::test_jpeg(32, 24, 99));
  write_file_atomically(folder.path() / "garbage.mkv", std::string(5000, 'x'));
  using Ffmpeg = schemas::RecordConfig::FfmpegSource;
  const auto is_configuration = [&](const schemas::RecordConfig::Source& source) {
    try {
      open_frame_source({"c", source}, folder.path());
      ADD_FAILURE() << "opened";
      return false;
    } catch (const ConfigurationError& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.where(), ::testing::StartsWith("camera \"c\", "));
      return true;
    } catch (const Error& error) {
      return false;
    }
  };
  const auto with_options = [](const std::string& url, std::map<std::string, std::string> options) {
    Ffmpeg source;
    source.url = url;
    source.options = std::move(options);
    return source;
  };
  EXPECT_TRUE(is_configuration(with_options("a.jpg", {{"no_such_option", "1"}})));
  EXPECT_TRUE(is_configuration(with_options("missing.mkv", {})));
  EXPECT_TRUE(is_configuration(with_options("no_such_format:a.jpg", {})));
  EXPECT_TRUE(is_configuration(with_options("gopher://127.0.0.1/a", {})));
  EXPECT_TRUE(is_configuration(with_options("tcp://127.0.0.1", {})));
  EXPECT_TRUE(is_configuration(with_options("lavfi:no_such_filter=1", {})));
  EXPECT_TRUE(is_configuration(with_options("lavfi:movie=a.jpg", {})));
  EXPECT_TRUE(is_configuration(with_options("concat:a.jpg|a.jpg", {})));
  EXPECT_TRUE(is_configuration(with_options("pipe:missing", {})));
  Ffmpeg unknown_format;
  unknown_format.url = "a.jpg";
  unknown_format.format = "no_such_format";
  EXPECT_TRUE(is_configuration(unknown_format));
  schemas::RecordConfig::SimulatedSource simulated;
  simulated.index = 1000;
  EXPECT_TRUE(is_configuration(simulated));

  EXPECT_FALSE(is_configuration(with_options("tcp://127.0.0.1:1", {})));  // nothing answers
  EXPECT_FALSE(is_configuration(with_options("http://127.0.0.1:1/a", {})));
  EXPECT_FALSE(is_configuration(with_options("garbage.mkv", {})));
}

}  // namespace
}  // namespace raystage::ingest
