// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/open_frame_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
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

}  // namespace
}  // namespace raystage::ingest
