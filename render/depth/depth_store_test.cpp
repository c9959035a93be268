// SPDX-License-Identifier: Apache-2.0
#include "render/depth/depth_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <set>

#include "base/atomic_file.h"
#include "base/error.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render {
namespace {

namespace fs = std::filesystem;
using std::chrono::hours;

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  return names;
}

std::string name_of(int set) { return "00000000000000a" + std::to_string(set); }

TEST(DepthStore, KeepsTheSetsUsedLastAndThoseInUse) {
  const testing::TestFolder folder;
  const fs::file_time_type now = fs::file_time_type::clock::now();
  for (int i = 0; i < 8; ++i) {
    const fs::path set = folder.path() / name_of(i);
    create_folder(set);
    write_file_atomically(set / "0123456789abcdef.zst", std::string_view("depths"));
    fs::last_write_time(set, now - hours(i < 5 ? 0 : 24 * i));
  }
  const fs::path old_file = folder.path() / "0123456789abcdef.zst";
  write_file_atomically(old_file, std::string_view("of an earlier version"));
  fs::last_write_time(old_file, now - hours(30));
  for (const char* name : {"notes", "0123456789abcdef.txt"}) {
    write_file_atomically(folder.path() / name, std::string_view("not ours"));
    fs::last_write_time(folder.path() / name, now - hours(1000));
  }
  prune_depth_sets(folder.path(), now);  // five within the hour
  EXPECT_EQ(names_in(folder.path()),
            (std::set<std::string>{name_of(0), name_of(1), name_of(2), name_of(3), name_of(4),
                                   "notes", "0123456789abcdef.txt"}));
  fs::last_write_time(folder.path() / name_of(2), now - hours(2));
  prune_depth_sets(folder.path(), now);
  EXPECT_EQ(names_in(folder.path()).count(name_of(2)), 0U);
  prune_depth_sets(folder.path(), now + hours(1000));  // four stay, however old
  EXPECT_EQ(names_in(folder.path()).size(), 6U);
  prune_depth_sets(folder.path() / "missing", now);
  prune_depth_sets(folder.path() / "notes", now);
}

TEST(DepthStore, KeepsSetsThatArePinned) {
  const testing::TestFolder folder;
  const fs::file_time_type now = fs::file_time_type::clock::now();
  for (int i = 0; i < 7; ++i) {
    const fs::path set = folder.path() / name_of(i);
    if (i == 5 || i == 6) {
      pin_depth_set(set, "job");
    } else {
      create_folder(set);
    }
    if (i == 6) fs::last_write_time(set / "pin.job", now - kMaxPinTime - hours(1));
    fs::last_write_time(set, now - hours(24 * (i + 1)));
  }
  prune_depth_sets(folder.path(), now);  // four used last, and the one with a young pin
  const std::set<std::string> kept = {name_of(0), name_of(1), name_of(2), name_of(3), name_of(5)};
  EXPECT_EQ(names_in(folder.path()), kept);
  unpin_depth_set(folder.path() / name_of(5), "another");
  prune_depth_sets(folder.path(), now);
  EXPECT_EQ(names_in(folder.path()), kept);
  unpin_depth_set(folder.path() / name_of(5), "job");
  unpin_depth_set(folder.path() / name_of(5), "job");  // a missing one is no error
  fs::last_write_time(folder.path() / name_of(5), now - hours(144));
  prune_depth_sets(folder.path(), now);
  EXPECT_EQ(names_in(folder.path()).count(name_of(5)), 0U);
}

TEST(DepthStore, APinIsAFileName) {
  const testing::TestFolder folder;
  const fs::path set = folder.path() / name_of(0);
  for (const std::string& job :
       {std::string(), std::string("a/b"), std::string("a\0b", 3), std::string(201, 'a')}) {
    EXPECT_THROW(pin_depth_set(set, job), Error) << job;
  }
  EXPECT_FALSE(fs::exists(set));
  pin_depth_set(set, std::string(200, 'a'));
  EXPECT_EQ(names_in(set), std::set<std::string>{"pin." + std::string(200, 'a')});
}

TEST(DepthStore, NothingIsWrittenOrDeletedBehindALink) {
  const testing::TestFolder folder;
  const fs::path victim = folder.path() / "victim", take = folder.path() / "take";
  create_folder(victim / "0123456789abcdef");
  create_folder(take);
  fs::create_symlink("../victim", take / "depth");
  EXPECT_THROW(pin_depth_set(take / "depth" / "0123456789abcdef", "job"), Error);
  write_file_atomically(victim / "0123456789abcdef" / "pin.job", std::string_view());
  unpin_depth_set(take / "depth" / "0123456789abcdef", "job");  // the end of a job must not fail
  EXPECT_EQ(names_in(victim / "0123456789abcdef"), std::set<std::string>{"pin.job"});
}

TEST(DepthStore, RemovesWhatWasLeftHalfWritten) {
  const testing::TestFolder folder;
  const fs::file_time_type now = fs::file_time_type::clock::now();
  const fs::path set = folder.path() / name_of(1);
  create_folder(set);
  const std::string old = ".0123456789abcdef.zst.host.17.0.tmp.zst";
  const std::string recent = ".0123456789abcdef.zst.host.18.0.tmp.zst";
  for (const std::string& name : {old, recent, std::string("0123456789abcdef.zst")}) {
    write_file_atomically(set / name, std::string_view("depths"));
    fs::last_write_time(set / name, now - hours(name == recent ? 0 : 2));
  }
  fs::last_write_time(set, now);
  prune_depth_sets(folder.path(), now);
  EXPECT_EQ(names_in(set), (std::set<std::string>{recent, "0123456789abcdef.zst"}));
}

class TakeWithDepths : public ::testing::Test {
 protected:
  TakeWithDepths() {
    testing::SyntheticTake recorded;
    recorded.cameras = testing::camera_grid(1, 2, 0.1, 24, 16);
    write_synthetic_take(recorded, folder_.path() / "take");
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
    cache_ = std::make_unique<store::FrameCache>(*take_, std::size_t{1} << 24,
                                                 store::BlendSpace::kPerceptual);
    instant_.take = take_.get();
    instant_.rig = &take_->rig();
    instant_.cache = cache_.get();
    instant_.frame_of_camera.assign(2, 0);
  }
  /// Estimates depths up to `far` metres, last used `ago`; returns the folder of their set.
  fs::path ask(double far, hours ago) {
    DepthEstimationOptions options;
    options.scene = {3, far};
    std::string note;
    load_or_estimate_camera_depths(instant_, options, std::size_t{1} << 28, true, note);
    EXPECT_EQ(note, "");
    const fs::path set =
        depth_file_path(take_->folder(), depth_store_key(instant_, options)).parent_path();
    EXPECT_TRUE(fs::exists(set));
    fs::last_write_time(set, fs::file_time_type::clock::now() - ago);
    return set;
  }
  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
  std::unique_ptr<store::FrameCache> cache_;
  LightFieldFrame instant_;
};

/// Replaces the first `from` by `to` in a document of the take, and opens the take.
store::Take with(const fs::path& take, const char* file, const std::string& from,
                 const std::string& to) {
  std::string text = read_file(take / file);
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << text;
  write_file_atomically(take / file, text.replace(at, from.size(), to));
  return store::Take(take);
}

TEST_F(TakeWithDepths, WhatFramesMeanIsPartOfTheKey) {
  const DepthStoreKey before = depth_store_key(instant_, {});
  const store::Take linear = with(take_->folder(), "take.json", "srgb_texture", "lin_rec709_scene");
  EXPECT_EQ(depth_store_key(instant_, {}), before);  // the key uses the take as it was opened
  LightFieldFrame other = instant_;
  other.take = &linear;
  EXPECT_NE(depth_store_key(other, {}).set, before.set);
  EXPECT_NE(depth_store_key(other, {}).instant, before.instant);
}

TEST_F(TakeWithDepths, TheRigThatIsUsedIsPartOfTheKeyNotTheFile) {
  const DepthStoreKey before = depth_store_key(instant_, {});
  rig::Rig moved = take_->rig();
  moved.cameras[1].pose.position.x() += 1e-9;
  rig::Rig brighter = take_->rig();
  brighter.cameras[1].photometric.contrast[2] += 1e-9;
  rig::Rig vignetted = take_->rig();
  vignetted.cameras[0].photometric.vignetting = schemas::Vignetting{1, 1, {0, 0, 1e-9}};
  rig::Rig spotted = take_->rig();
  spotted.cameras[1].photometric.hot_pixels = {{0, 0, {0, 0, 1e-9}}};
  for (const rig::Rig* rig : {&moved, &brighter, &vignetted, &spotted}) {
    LightFieldFrame other = instant_;
    other.rig = rig;
    EXPECT_NE(depth_store_key(other, {}).set, before.set);
  }
  write_file_atomically(take_->folder() / "rig.json", std::string_view("calibrated meanwhile"));
  EXPECT_EQ(depth_store_key(instant_, {}), before);
}

TEST_F(TakeWithDepths, WhoMayWriteMarksAsUsedAlsoWhatIsAnothers) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can be somebody else";
  const fs::path set = ask(5, hours(10));
  for (fs::path at = set; at != folder_.path().parent_path(); at = at.parent_path()) {
    fs::permissions(at, fs::perms::all);
  }
  constexpr uid_t kNobody = 65534;
  ASSERT_EQ(seteuid(kNobody), 0);
  DepthEstimationOptions options;
  options.scene = {3, 5};
  std::string note;
  load_or_estimate_camera_depths(instant_, options, std::size_t{1} << 28, true, note);
  ASSERT_EQ(seteuid(0), 0);
  EXPECT_LT(fs::file_time_type::clock::now() - fs::last_write_time(set), hours(1));
}

TEST_F(TakeWithDepths, BehindALinkTheyAreNeitherReadNorStored) {
  const fs::path victim = folder_.path() / "victim";
  create_folder(victim);
  fs::create_symlink("../victim", take_->folder() / "depth");
  DepthEstimationOptions options;
  options.scene = {3, 5};
  std::string note;
  const CameraDepths depths =
      load_or_estimate_camera_depths(instant_, options, std::size_t{1} << 28, true, note);
  EXPECT_FALSE(depths.maps.empty());
  EXPECT_THAT(note, ::testing::HasSubstr("is a link"));
  EXPECT_TRUE(fs::is_empty(victim));
}

TEST_F(TakeWithDepths, OfFewRegionsOfAFrameTheLastAreKept) {
  DepthEstimationOptions options;
  options.scene = {3, 5};
  std::string note;
  const auto store = [&](int right) {
    options.regions = {{0, 0, right, 16}, {}};
    const CameraDepths depths =
        load_or_estimate_camera_depths(instant_, options, std::size_t{1} << 28, true, note);
    EXPECT_EQ(depths.maps[0].width, right);
    EXPECT_TRUE(depths.maps[1].values.empty());
    return depth_file_path(take_->folder(), depth_store_key(instant_, options));
  };
  load_or_estimate_camera_depths(instant_, options, std::size_t{1} << 28, true, note);
  const fs::path all = depth_file_path(take_->folder(), depth_store_key(instant_, options));
  std::vector<fs::path> files;
  for (int i = 0; i < 5; ++i) {
    files.push_back(store(16 + i));
    fs::last_write_time(files.back(), fs::file_time_type::clock::now() - hours(10 - i));
  }
  EXPECT_EQ(files[0].parent_path(), all.parent_path());
  const auto prune = [&] {
    prune_depth_regions(all.parent_path(), fs::file_time_type::clock::now());
  };
  prune();
  EXPECT_TRUE(fs::exists(all));
  EXPECT_FALSE(fs::exists(files[0])) << "used last the longest ago";
  EXPECT_TRUE(fs::exists(files[1]));
  EXPECT_TRUE(fs::exists(files[4]));
  EXPECT_EQ(names_in(all.parent_path()).size(), 1U + kMaxStoredRegions);
  StoredDataCounts counts;
  instant_.stored_data_counts = &counts;
  store(17);
  EXPECT_EQ(counts.read, 1);
  EXPECT_EQ(counts.derived, 0);
  // Those in use, by this hour or by a pin, stay.
  pin_depth_set(all.parent_path(), "job");
  fs::last_write_time(files[2], fs::file_time_type::clock::now() - hours(20));
  store(22);
  prune();
  EXPECT_TRUE(fs::exists(files[2]));
  unpin_depth_set(all.parent_path(), "job");
  prune();
  EXPECT_FALSE(fs::exists(files[2]));
  EXPECT_TRUE(fs::exists(files[1])) << "read above";
}

TEST_F(TakeWithDepths, OtherOptionsMakeRoomForThemselves) {
  std::vector<fs::path> sets;
  for (int i = 0; i < 4; ++i) sets.push_back(ask(5 + i, hours(10 - i)));
  EXPECT_EQ(names_in(take_->folder() / "depth").size(), 4U);
  // Last use counts, not age: the first is used again, so the second is removed.
  DepthEstimationOptions first;
  first.scene = {3, 5};
  std::string note;
  load_or_estimate_camera_depths(instant_, first, std::size_t{1} << 28, true, note);
  ask(20, hours(0));
  EXPECT_TRUE(fs::exists(sets[0]));
  EXPECT_FALSE(fs::exists(sets[1]));
  EXPECT_EQ(names_in(take_->folder() / "depth").size(), 4U);
}

}  // namespace
}  // namespace raystage::render
