// SPDX-License-Identifier: Apache-2.0
// Takes whose frames refer to those of other cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/error.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/jpeg/encode.h"
#include "store/matroska.h"
#include "store/packing/pack_take.h"
#include "store/packing/pack_temporal.h"
#include "store/take_summary.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

constexpr int kRows = 2, kColumns = 3, kCount = kRows * kColumns, kInstants = 4, kGroupCameras = 4;
constexpr int kSide = 96;

/// Random blocks, those of a camera two pixels beside those of the one before.
RgbImage random_picture(int camera, int instant) {
  std::mt19937 random(static_cast<unsigned>(instant));
  std::vector<std::uint8_t> blocks(3000);
  for (std::uint8_t& value : blocks) value = static_cast<std::uint8_t>(40 + random() % 160);
  RgbImage image;
  image.width = kSide;
  image.height = kSide;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int column = (x + 2 * (camera % kColumns)) / 6, row = (y + 2 * (camera / kColumns)) / 6;
      for (int c = 0; c < 3; ++c) {
        image.values.push_back(blocks[static_cast<std::size_t>(3 * (30 * row + column) + c)]);
      }
    }
  }
  return image;
}

/// Of irregular frames; cameras are a few milliseconds apart.
Nanoseconds time_of(int camera, int instant) {
  return 66'666'667LL * instant + 1'013'001LL * camera + 77LL * instant * instant;
}

class PackAcrossCamerasTest : public ::testing::TestWithParam<VideoCodec> {
 protected:
  static void SetUpTestSuite() { silence_encoders(); }
  void SetUp() override {
    schemas::RigDocument rig = testing::rig_document(kCount);
    for (int i = 0; i < kCount; ++i) {
      auto& geometry = rig.cameras[static_cast<std::size_t>(i)].geometry;
      geometry.width = kSide;
      geometry.height = kSide;
      geometry.row = i / kColumns;
      geometry.column = i % kColumns;
    }
    TakeWriter writer(path("take"), testing::take_document(kCount), rig);
    for (int camera = 0; camera < kCount; ++camera) {
      for (int i = 0; i < kInstants; ++i) {
        const Nanoseconds time = time_of(camera, i);
        if (camera == 1 && i == 2) {  // a gap
          writer.archive(camera).append_missing(FrameStatus::kDroppedBySource, time, {time + 9, 2});
          continue;
        }
        writer.archive(camera).append_again(
            {time, 0, 0, FrameStatus::kStored, 0, time + 7, static_cast<std::uint64_t>(i), false},
            encode_jpeg(random_picture(camera, i), {}));
      }
    }
    writer.commit();
  }
  fs::path path(const std::string& name) const { return folder_.path() / name; }
  TemporalReport pack(const std::string& name, References references, int group) const {
    TemporalOptions options;
    options.video = {GetParam(), GetParam() == VideoCodec::kHevc ? 22.0 : 30.0, group};
    options.references = references;
    return pack_temporal(Take(path("take")), path(name), options);
  }
  TemporalReport pack() const { return pack("packed", References::kCameras, kGroupCameras); }
  /// Changes a byte of the stored frame of a camera.
  void damage(int camera, int frame) const {
    const fs::path file = path("packed") / "archive" / ("c" + std::to_string(camera) + ".mkv");
    Bytes bytes = testing::bytes_of(file);
    bytes[Take(path("packed")).archive(camera).frames()[frame].offset + 70] ^= std::byte{4};
    testing::overwrite(file, bytes);
  }
  static bool is_intact(const fs::path& take, bool decode) {
    TakeVerifyOptions options;
    options.decode = decode;
    return verify_take(take, options).is_intact();
  }

  testing::TestFolder folder_;
};

double psnr_of_pictures(std::span<const std::byte> a, std::span<const std::byte> b) {
  const double error = mean_square_error(planes_of_jpeg(a, kSide, kSide, "a"),
                                         planes_of_jpeg(b, kSide, kSide, "b"), kSide, kSide);
  return 10 * std::log10(255 * 255 / std::max(error, 1e-9));
}

TEST_P(PackAcrossCamerasTest, TimesGapsAndPicturesAreThoseOfTheSource) {
  const TemporalReport report = pack();
  EXPECT_EQ(report.total().frames, kCount * kInstants - 1);
  EXPECT_EQ(report.total().groups, kInstants * 2);
  const Take source(path("take")), packed(path("packed"));
  for (int camera = 0; camera < kCount; ++camera) {
    const ArchiveReader &a = source.archive(camera), &b = packed.archive(camera);
    ASSERT_EQ(a.records().size(), b.records().size());
    for (std::size_t i = 0; i < a.records().size(); ++i) {
      const FrameRecord &was = a.records()[i], &is = b.records()[i];
      EXPECT_EQ(is.time_ns, was.time_ns);
      EXPECT_EQ(is.status, was.status);
      EXPECT_EQ(is.arrival_ns, was.arrival_ns);
      EXPECT_EQ(is.sequence, was.sequence);
    }
    for (int frame = 0; frame < static_cast<int>(b.frames().size()); ++frame) {
      EXPECT_FALSE(b.is_rotten(frame));
      const double same = psnr_of_pictures(a.jpeg(frame), b.jpeg(frame));
      EXPECT_GE(same, report.cameras[static_cast<std::size_t>(camera)].min_psnr_db - 1e-6);
      const int other = (camera + 1) % kCount;
      EXPECT_GT(same, psnr_of_pictures(source.archive(other).jpeg(0), b.jpeg(frame)) + 6);
    }
  }
  EXPECT_TRUE(is_intact(path("packed"), true));
  EXPECT_EQ(summarise_take(packed).cameras[0].video,
            std::string(name_of(GetParam())) + " across cameras");
}

TEST_P(PackAcrossCamerasTest, NeighboursSaveBytes) {
  const auto across = pack().total(), alone = pack("alone", References::kTime, 1).total();
  EXPECT_LT(1.5 * static_cast<double>(across.bytes_after), static_cast<double>(alone.bytes_after));
}

TEST_P(PackAcrossCamerasTest, AnyOrderOfReadingGivesTheSamePictures) {
  pack();
  std::vector<std::pair<int, int>> frames;
  std::vector<Bytes> in_order;
  {
    const Take take(path("packed"));
    for (int camera = 0; camera < kCount; ++camera) {
      for (int i = 0; i < static_cast<int>(take.archive(camera).frames().size()); ++i) {
        frames.emplace_back(camera, i);
        const FrameBytes jpeg = take.archive(camera).jpeg(i);
        in_order.emplace_back(jpeg.begin(), jpeg.end());
      }
    }
  }
  for (const std::size_t budget : {std::size_t{0}, std::size_t{1} << 26}) {
    const Take take(path("packed"));
    take.unpacked_frames().set_budget(budget);
    std::vector<std::size_t> order(frames.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), std::mt19937(3));
    for (const std::size_t i : order) {
      const auto [camera, frame] = frames[i];
      EXPECT_TRUE(std::ranges::equal(take.archive(camera).jpeg(frame), in_order[i]));
    }
  }
}

TEST_P(PackAcrossCamerasTest, DamageCostsTheCamerasAfterItInItsGroupOnly) {
  pack();
  damage(1, 1);
  const auto expect_lost = [&](const Take& take) {
    for (int camera = 0; camera < kCount; ++camera) {
      const ArchiveReader& archive = take.archive(camera);
      for (int frame = 0; frame < static_cast<int>(archive.frames().size()); ++frame) {
        const bool is_instant =
            std::abs(archive.frames()[frame].time_ns - time_of(0, 1)) < 20'000'000;
        // The group of camera 1 is 0, 1, 2, 5.
        const bool is_lost = is_instant && (camera == 1 || camera == 2 || camera == 5);
        EXPECT_EQ(archive.is_rotten(frame), is_lost) << camera << " " << frame;
        EXPECT_EQ(archive.intact_jpeg(frame).has_value(), !is_lost) << camera << " " << frame;
      }
    }
  };
  expect_lost(Take(path("packed")));
  const auto expect_undecodable = [&](const std::set<int>& cameras) {
    const TakeFixityReport found = verify_take(path("packed"), {});
    for (int camera = 0; camera < kCount; ++camera) {
      EXPECT_EQ(found.cameras[static_cast<std::size_t>(camera)].undecodable_frames.size(),
                cameras.contains(camera) ? 1U : 0U)
          << camera;
    }
  };
  EXPECT_FALSE(is_intact(path("packed"), false));
  expect_undecodable({2, 5});
  // Repaired, the frame is a gap, and those that refer to it are never decoded from another.
  repair_take(path("packed"), {});
  const Take repaired(path("packed"));
  ASSERT_EQ(repaired.archive(1).frames().size(), kInstants - 2);
  expect_lost(repaired);
  EXPECT_TRUE(is_intact(path("packed"), false));
  expect_undecodable({2, 5});
  EXPECT_FALSE(is_intact(path("packed"), true));
}

// The header's length says which codec it named.
TEST_P(PackAcrossCamerasTest, ADestroyedHeaderIsWrittenAgainWithItsCodec) {
  pack();
  const fs::path file = path("packed") / "archive" / "c1.mkv";
  const auto end = static_cast<std::size_t>(Take(path("packed")).archive(1).frames()[0].offset);
  for (const bool also_of_frame : {false, true}) {  // its Matroska header
    Bytes bytes = testing::bytes_of(file);
    std::fill_n(bytes.begin(), also_of_frame ? end : end - matroska::kClusterHeaderBytes,
                std::byte{0});
    testing::overwrite(file, bytes);
    EXPECT_FALSE(is_intact(path("packed"), false));
    repair_take(path("packed"), {});
    EXPECT_TRUE(is_intact(path("packed"), true)) << also_of_frame;
  }
}

TEST_P(PackAcrossCamerasTest, AnotherFrameIsNeverTakenForALostOne) {
  pack();
  // The archive of camera 1 is that of a take of other pictures at the same times.
  fs::rename(path("packed"), path("first"));
  {
    TakeWriter writer(path("other"), Take(path("take")).document(),
                      schemas::read_rig(Take(path("take")).file("rig.json")));
    const Take source(path("take"));
    for (int camera = 0; camera < kCount; ++camera) {
      int frame = 0;
      for (const FrameRecord& record : source.archive(camera).records()) {
        Bytes jpeg;
        if (record.status == FrameStatus::kStored) {
          jpeg = encode_jpeg(random_picture(camera, 50 + frame++), {});
        }
        writer.archive(camera).append_again(record, jpeg);
      }
    }
    writer.commit();
  }
  fs::rename(path("take"), path("source"));
  fs::rename(path("other"), path("take"));
  pack();
  for (const char* file : {"archive/c1.mkv", "archive/c1.journal"}) {
    fs::copy(path("packed") / file, path("first") / file, fs::copy_options::overwrite_existing);
  }
  const Take mixed(path("first"));
  EXPECT_TRUE(mixed.archive(0).intact_jpeg(0));
  EXPECT_FALSE(mixed.archive(1).intact_jpeg(0));
  EXPECT_FALSE(mixed.archive(2).intact_jpeg(0));
  EXPECT_FALSE(mixed.archive(5).intact_jpeg(0));
  EXPECT_TRUE(mixed.archive(4).intact_jpeg(0));  // the first of the next group
  EXPECT_TRUE(mixed.archive(3).intact_jpeg(0));
}

TEST_P(PackAcrossCamerasTest, AMissingArchiveCostsThoseThatReferToIt) {
  pack();
  fs::remove(path("packed") / "archive" / "c2.mkv");
  const Take take(path("packed"));
  EXPECT_TRUE(take.archive(1).intact_jpeg(0));
  EXPECT_FALSE(take.archive(5).intact_jpeg(0));
  EXPECT_TRUE(take.archive(3).intact_jpeg(0));
}

TEST_P(PackAcrossCamerasTest, AMissingJournalCostsNothing) {
  pack();
  fs::remove(path("packed") / "archive" / "c1.journal");
  const Take take(path("packed"));
  EXPECT_TRUE(take.archive(5).intact_jpeg(0));
  EXPECT_TRUE(take.archive(5).intact_jpeg(kInstants - 1));
}

TEST_P(PackAcrossCamerasTest, AnArchiveAloneSaysThatItNeedsItsTake) {
  pack();
  const fs::path folder = path("packed") / "archive";
  const ArchiveReader alone(folder / "c2.mkv", folder / "c2.journal");
  EXPECT_THROW(alone.jpeg(0), Error);
  EXPECT_THROW(unpack_take(Take(path("packed")), path("again"), {}), Error);
  EXPECT_THROW(pack_take(Take(path("packed")), path("again"), {}), Error);
}

TEST_P(PackAcrossCamerasTest, AnExcerptHasTheFramesOfItsTime) {
  Excerpt excerpt{time_of(0, 1),
                  time_of(kCount, 1),
                  VideoSettings{GetParam(), 30, kGroupCameras},
                  {4},
                  References::kCameras};
  write_excerpt(Take(path("take")), path("part"), excerpt, {});
  const Take part(path("part")), source(path("take"));
  for (int camera = 0; camera < kCount; ++camera) {
    ASSERT_EQ(part.archive(camera).frames().size(), 1U);
    EXPECT_EQ(part.archive(camera).frames()[0].time_ns, time_of(camera, 1));
    const bool is_same =
        std::ranges::equal(part.archive(camera).jpeg(0), source.archive(camera).jpeg(1));
    EXPECT_EQ(is_same, camera == 4);
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, PackAcrossCamerasTest,
                         ::testing::Values(VideoCodec::kHevc, VideoCodec::kAv1),
                         [](const auto& test) { return std::string(name_of(test.param)); });

}  // namespace
}  // namespace raystage::store
