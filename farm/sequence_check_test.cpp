// SPDX-License-Identifier: Apache-2.0
#include "farm/sequence_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "compose/exr/exr_file.h"
#include "testing/compose/test_exr_view.h"
#include "testing/test_folder.h"

namespace raystage::farm {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class SequenceCheck : public ::testing::Test {
 protected:
  std::filesystem::path path(int frame) const { return name_.path(frame); }
  static void write(const std::filesystem::path& file, const std::string& fingerprint) {
    constexpr int kSize = 8;
    const std::vector<float> rgba(kSize * kSize * 4, 0.5F);
    const compose::ExrView view{"", {{"", {"R", "G", "B", "A"}, true, rgba, 0}}};
    compose::ExrCamera camera;
    camera.view.width = camera.view.height = kSize;
    camera.view.intrinsics = {kSize, kSize, kSize / 2.0, kSize / 2.0, {}};
    compose::ExrMetadata metadata;
    metadata.fingerprint = fingerprint;
    raystage::testing::write_exr({&view, 1}, {&camera, 1}, metadata, file);
  }
  std::vector<int> missing(double patience = 0, bool deep = false) const {
    SequenceCheckOptions options;
    options.timeout_seconds = patience;
    options.deep = deep;
    return missing_frames(name_, frames_, options, {});
  }
  testing::TestFolder folder_;
  const compose::SequenceName name_{(folder_.path() / "f.####.exr").string()};
  std::vector<ExpectedFrame> frames_{{1, "one"}, {2, "two"}, {3, "three"}};
};

TEST_F(SequenceCheck, FramesMustBeThereWholeAndTrue) {
  EXPECT_THAT(missing(), ElementsAre(1, 2, 3));
  write(path(1), "one");
  write(path(2), "another");
  write(path(3), "three");
  EXPECT_THAT(missing(), ElementsAre(2)) << "made from other inputs";
  write(path(2), "two");
  EXPECT_THAT(missing(), IsEmpty());
  std::filesystem::resize_file(path(3), std::filesystem::file_size(path(3)) - 1);
  EXPECT_THAT(missing(), ElementsAre(3)) << "torn";
}

TEST_F(SequenceCheck, DeepFilesCountWhereTheyAreWanted) {
  for (const ExpectedFrame& frame : frames_) write(path(frame.frame), frame.fingerprint);
  EXPECT_THAT(missing(0, true), ElementsAre(1, 2, 3));
}

TEST_F(SequenceCheck, WaitsForFilesOfOtherHostsAndNotForDamagedOnes) {
  write(path(1), "one");
  write(path(2), "two");
  std::thread late([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    write(path(3), "three");
  });
  constexpr double kLong = 60;
  EXPECT_THAT(missing(kLong), IsEmpty());
  late.join();
  write(path(2), "another");
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(missing(kLong), ElementsAre(2));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
}

}  // namespace
}  // namespace raystage::farm
