// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/recording_memory_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/resources.h"

namespace raystage::ingest {
namespace {

using ::testing::HasSubstr;

class Source final : public FrameSource {
 public:
  Source(std::size_t beside, bool jpeg) : beside_(beside) {
    description_.width = 1000;
    description_.height = 500;
    description_.delivers_jpeg = jpeg;
  }
  const SourceDescription& description() const override { return description_; }
  Outcome next(SourceFrame& /*frame*/, std::chrono::milliseconds /*patience*/) override {
    return Outcome::kEnded;
  }
  std::size_t memory_overhead() const override { return beside_; }

 private:
  SourceDescription description_;
  std::size_t beside_;
};

TEST(RecordingMemoryPlan, CountsSourcesAndEncoders) {
  RecorderOptions options;
  options.memory_bytes = 500'000'000;
  options.threads = 3;
  std::vector<RecorderCamera> cameras;
  cameras.push_back({"a", std::make_unique<Source>(7'000'000, true), {}});
  cameras.push_back({"b", std::make_unique<Source>(20'000'000, true), {}});
  EXPECT_EQ(plan_recording_memory(options, cameras).overhead, kProgramBytes + 27'000'000);
  cameras.push_back({"c", std::make_unique<Source>(0, false), {}});
  const RecordingMemoryPlan plan = plan_recording_memory(options, cameras);
  EXPECT_EQ(plan.frames, 500'000'000U);
  EXPECT_EQ(plan.overhead, kProgramBytes + 27'000'000 + std::size_t{3} * 3 * 1000 * 500);
  EXPECT_THAT(format_memory_plan(plan), HasSubstr("500 MB for frames, plus up to about 99 MB"));
}

TEST(RecordingMemoryPlan, RefusesMoreThanThereIsAndWarnsNearIt) {
  EXPECT_NO_THROW(check_recording_memory(1000, 1000));
  try {
    check_recording_memory(3'000'000'000, 2'000'000'000);
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("3000 MB"));
    EXPECT_THAT(error.what(), HasSubstr("2000 MB"));
  }
  EXPECT_EQ(memory_warning({600, 200}, 1000), "");
  EXPECT_THAT(memory_warning({600'000'000, 201'000'000}, 1'000'000'000),
              AllOf(HasSubstr("801 MB"), HasSubstr("1000 MB")));
}

TEST(Resources, NoMoreIsFreeThanThereIs) {
  EXPECT_GT(free_memory(), std::size_t{1} << 20);
  EXPECT_LE(free_memory(), available_memory());
  // Used memory is not free. Other processes change it meanwhile, so a quarter suffices.
  const std::size_t before = free_memory();
  constexpr std::size_t kBytes = std::size_t{400} << 20;
  if (before < 2 * kBytes) GTEST_SKIP() << "too little memory is free";
  const std::vector<char> used(kBytes, 'x');
  EXPECT_LT(free_memory(), before - kBytes / 4);
}

}  // namespace
}  // namespace raystage::ingest
