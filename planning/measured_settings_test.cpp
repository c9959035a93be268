// SPDX-License-Identifier: Apache-2.0
#include "planning/measured_settings.h"

#include <gtest/gtest.h>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::planning {
namespace {

TEST(MeasuredSettings, ReadsAndSuggests) {
  const testing::TestFolder folder;
  const auto file = folder.path() / "trade.json";
  write_file_atomically(file, R"({"schema": "raystage/trade/1", "take": "t", "rows": [
    {"label": "fast", "method": "focal_plane", "camera_step": 1, "psnr_db": 24, "seconds_per_frame": 0.05,
     "peak_memory_bytes": null, "on_psnr_front": true},
    {"label": "sweep", "method": "plane_sweep", "psnr_db": 34.8, "seconds_per_frame": 0.4, "on_psnr_front": true},
    {"label": "depth", "method": "depth", "psnr_db": 35.2, "seconds_per_frame": 1.5,
     "peak_memory_bytes": 2e9, "on_psnr_front": true},
    {"label": "depth coarse", "method": "depth", "psnr_db": 33, "seconds_per_frame": 1.2, "on_psnr_front": false},
    {"label": "half", "method": "depth", "camera_step": 2, "psnr_db": 40, "seconds_per_frame": 1, "on_psnr_front": true},
    {"label": "failed", "method": "slabs", "failure": "no grid", "psnr_db": null, "seconds_per_frame": null},
    7]})");
  const auto settings = read_measured_settings(file);
  ASSERT_EQ(settings.size(), 4U);
  EXPECT_EQ(suggested_setting(settings)->label, "sweep");
  EXPECT_EQ(setting_of_method(settings, "depth")->label, "depth");
  EXPECT_EQ(*setting_of_method(settings, "depth")->peak_memory_bytes, 2e9);
  EXPECT_EQ(setting_of_method(settings, "slabs"), nullptr);
  EXPECT_EQ(suggested_setting({}), nullptr);
}

TEST(MeasuredSettings, RefuseOtherFiles) {
  const testing::TestFolder folder;
  const auto file = folder.path() / "trade.json";
  for (const char* text : {"", "[]", "{}", R"({"schema": "raystage/rig/1"})",
                           R"({"schema": "raystage/trade/1", "rows": 3})"}) {
    write_file_atomically(file, text);
    EXPECT_THROW(read_measured_settings(file), Error) << text;
  }
  EXPECT_THROW(read_measured_settings(folder.path() / "none.json"), Error);
}

}  // namespace
}  // namespace raystage::planning
