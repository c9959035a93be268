// SPDX-License-Identifier: Apache-2.0
#include "store/frames_by_hash.h"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "store/camera_groups.h"
#include "store/temporal/temporal_frame.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::store::frames_by_hash_test {
namespace {

using Bytes = std::vector<std::byte>;
using Place = std::pair<int, int>;  // camera, frame

constexpr Nanoseconds kStep = 50'000'000;

/// A temporal frame whose packet is `content`.
Bytes frame_of(std::uint32_t position, std::uint64_t previous, int content) {
  Bytes packet(40, static_cast<std::byte>(content % 200 + 1));
  packet.back() = static_cast<std::byte>(content / 200 + 1);
  return make_temporal_frame(VideoCodec::kHevc, {position, previous, 0, 0}, packet);
}

/// The archives of a take, which counts how often one is asked for.
class CountedArchives : public TakeArchives {
 public:
  explicit CountedArchives(const std::filesystem::path& folder) : take_(folder) {}
  int camera_count() const override { return take_.camera_count(); }
  const ArchiveReader& archive(int camera) const override {
    ++asked;
    return take_.archive(camera);
  }
  const FramesByHash& frames_by_hash() const override { return by_hash_; }
  mutable std::atomic<int> asked = 0;

 private:
  Take take_;
  FramesByHash by_hash_;
};

class FramesByHashTest : public ::testing::Test {
 protected:
  /// `frames`: of each camera, a step apart.
  void write(const std::vector<std::vector<Bytes>>& frames) {
    const int cameras = static_cast<int>(frames.size());
    TakeWriter writer(folder_.path() / "take", testing::take_document(cameras),
                      testing::rig_document(cameras), FrameCodec::kHevcCameras);
    for (int camera = 0; camera < cameras; ++camera) {
      Nanoseconds time = 0;
      for (const Bytes& frame : frames[static_cast<std::size_t>(camera)]) {
        writer.archive(camera).append(frame, time += kStep);
      }
    }
    writer.commit();
    take_.emplace(folder_.path() / "take");
  }
  /// The slow search that find() replaces.
  std::vector<Place> search(std::uint64_t xxh3) const {
    std::vector<Place> found;
    for (int camera = 0; camera < take_->camera_count(); ++camera) {
      const auto frames = take_->archive(camera).frames();
      for (std::size_t i = 0; i < frames.size(); ++i) {
        if (frames[i].xxh3 == xxh3) found.emplace_back(camera, static_cast<int>(i));
      }
    }
    return found;
  }
  std::vector<Place> find(std::uint64_t xxh3) const {
    std::vector<Place> found;
    for (const FramesByHash::Entry& entry : take_->frames_by_hash().find(*take_, xxh3)) {
      found.emplace_back(entry.camera, entry.frame);
    }
    return found;
  }

  testing::TestFolder folder_;
  std::optional<CountedArchives> take_;
};

TEST_F(FramesByHashTest, FindsWhatASearchFinds) {
  std::vector<std::vector<Bytes>> frames(3);
  for (int i = 0; i < 60; ++i) {
    for (int camera = 0; camera < 3; ++camera) {
      // Every third frame is the same in all cameras, and some twice in one.
      const int content = i % 3 == 0 ? i % 12 : 100 * camera + i;
      frames[static_cast<std::size_t>(camera)].push_back(frame_of(0, 0, content));
    }
  }
  write(frames);
  std::set<std::uint64_t> hashes{1, 2, ~std::uint64_t{0}};
  for (int camera = 0; camera < 3; ++camera) {
    for (const FrameRecord& frame : take_->archive(camera).frames()) hashes.insert(frame.xxh3);
  }
  EXPECT_GT(hashes.size(), 100U);
  const std::vector<std::uint64_t> wanted(hashes.begin(), hashes.end());
  raystage::parallel_for(std::size_t{0}, wanted.size(), [&](std::size_t i) {
    EXPECT_EQ(find(wanted[i]), search(wanted[i])) << wanted[i];
  });
}

TEST_F(FramesByHashTest, AGroupIsFoundWhereTimesSayNothing) {
  std::vector<std::vector<Bytes>> frames(2);
  const Bytes first = frame_of(0, 0, 1000);
  for (int i = 0; i < 20; ++i) frames[0].push_back(i == 2 ? first : frame_of(0, 0, i));
  for (int i = 0; i < 20; ++i) {
    frames[1].push_back(i == 17 ? frame_of(1, hash_of_stored(first), 7) : frame_of(0, 0, 100 + i));
  }
  write(frames);
  const std::vector<GroupMember> group = group_up_to(*take_, 1, 17);
  ASSERT_EQ(group.size(), 2U);
  EXPECT_EQ(std::pair(group[0].camera, group[0].frame), Place(0, 2));
  EXPECT_EQ(std::pair(group[1].camera, group[1].frame), Place(1, 17));
}

/// A take can hold one frame many times, which no group goes on from.
TEST_F(FramesByHashTest, FewCopiesAreTried) {
  std::vector<std::vector<Bytes>> frames(2);
  const Bytes copy = frame_of(5, 1, 1000);
  for (int i = 0; i < 400; ++i) frames[0].push_back(copy);
  frames[1].push_back(frame_of(9, hash_of_stored(copy), 7));
  write(frames);
  EXPECT_TRUE(group_up_to(*take_, 1, 0).empty());
  EXPECT_LT(take_->asked, 100);
}

}  // namespace
}  // namespace raystage::store::frames_by_hash_test
