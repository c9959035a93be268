// SPDX-License-Identifier: Apache-2.0
#include "store/packing/pack_temporal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "base/child_process.h"
#include "base/error.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/jpeg/encode.h"
#include "store/packing/pack_take.h"
#include "store/rotten_frame.h"
#include "store/temporal/temporal_frame.h"
#include "testing/store/take_test_data.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Bytes = std::vector<std::byte>;

constexpr int kRow = 2, kPictures = 11, kGroup = 4;
// Neither coded pictures nor rows of memory are whole.
constexpr int kWidth = 300, kHeight = 230;

/// A pattern that moves to the right by two pixels a frame.
RgbImage moving_picture(int frame, int camera) {
  RgbImage image;
  image.width = kWidth;
  image.height = kHeight;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int at = x - 2 * frame + 5 * camera;
      const bool inside = (at / 24 + y / 24) % 2 == 0;
      image.values.push_back(static_cast<std::uint8_t>(inside ? 60 + y / 3 : 180));
      image.values.push_back(static_cast<std::uint8_t>(inside ? 90 : 200 - y / 3));
      image.values.push_back(static_cast<std::uint8_t>(inside ? 150 : 40 + (at & 31)));
    }
  }
  return image;
}

std::string output_of(const std::vector<std::string>& command) {
  const ChildResult result = run_child(command);
  EXPECT_EQ(result.exit_code, 0) << result.out;
  return result.out;
}

/// Of irregular frames. Far from each other, so that no rate is stated for them.
Nanoseconds time_of(int frame) { return 66'666'667LL * frame + 1013LL * frame * frame; }

double psnr_between(std::span<const std::byte> a, std::span<const std::byte> b) {
  const double error = mean_square_error(planes_of_jpeg(a, kWidth, kHeight, "a"),
                                         planes_of_jpeg(b, kWidth, kHeight, "b"), kWidth, kHeight);
  return 10 * std::log10(255 * 255 / std::max(error, 1e-9));
}

class PackTemporalTest : public ::testing::TestWithParam<VideoCodec> {
 protected:
  static void SetUpTestSuite() { silence_encoders(); }
  void SetUp() override {
    schemas::RigDocument rig = testing::rig_document(kRow);
    for (schemas::RigDocument::Camera& camera : rig.cameras) {
      camera.geometry.width = kWidth;
      camera.geometry.height = kHeight;
    }
    TakeWriter writer(path("take"), testing::take_document(kRow), rig);
    for (int camera = 0; camera < kRow; ++camera) {
      ArchiveWriter& out = writer.archive(camera);
      for (int i = 0; i < kPictures; ++i) {
        const Nanoseconds time = time_of(i);
        const auto sequence = static_cast<std::uint64_t>(i);
        out.append_again({time, 0, 0, FrameStatus::kStored, 0, time + 7, sequence, i == 2},
                         encode_jpeg(moving_picture(i, camera), {}));
        if (i == 5) out.append_missing(FrameStatus::kDroppedLate, time + 5, {time + 9, sequence});
      }
    }
    writer.commit();
  }
  fs::path path(const std::string& name) const { return folder_.path() / name; }
  TemporalOptions options(int group = kGroup) const {
    TemporalOptions result;
    result.video = {GetParam(), GetParam() == VideoCodec::kHevc ? 22.0 : 30.0, group};
    return result;
  }
  TemporalReport pack(int group = kGroup) const {
    return pack_temporal(Take(path("take")), path("packed"), options(group));
  }

  testing::TestFolder folder_;
};

TEST_P(PackTemporalTest, TimesGapsAndPicturesAreThoseOfTheSource) {
  const TemporalReport report = pack();
  const TemporalReport::Camera total = report.total();
  EXPECT_EQ(total.frames, kRow * kPictures);
  EXPECT_EQ(total.groups, kRow * 3);
  EXPECT_LT(4 * total.bytes_after, total.bytes_before);
  EXPECT_GT(total.min_psnr_db, 30);

  const Take source(path("take")), packed(path("packed"));
  for (int camera = 0; camera < kRow; ++camera) {
    const ArchiveReader &a = source.archive(camera), &b = packed.archive(camera);
    ASSERT_EQ(a.records().size(), b.records().size());
    for (std::size_t i = 0; i < a.records().size(); ++i) {
      const FrameRecord &was = a.records()[i], &is = b.records()[i];
      EXPECT_EQ(is.time_ns, was.time_ns);
      EXPECT_EQ(is.status, was.status);
      EXPECT_EQ(is.arrival_ns, was.arrival_ns);
      EXPECT_EQ(is.sequence, was.sequence);
      EXPECT_EQ(is.is_unverified, was.is_unverified);
    }
    for (int frame = 0; frame < kPictures; ++frame) {
      EXPECT_FALSE(b.is_rotten(frame));
      const double same = psnr_between(a.jpeg(frame), b.jpeg(frame));
      EXPECT_GE(same, report.cameras[static_cast<std::size_t>(camera)].min_psnr_db - 1e-6);
      // Another frame of the pattern is far from it.
      const double other = psnr_between(a.jpeg((frame + 1) % kPictures), b.jpeg(frame));
      EXPECT_GT(same, other + 6) << frame;
      EXPECT_NE(b.jpeg_xxh3(frame), a.jpeg_xxh3(frame));
    }
  }
  TakeVerifyOptions decoding;
  decoding.decode = true;
  EXPECT_TRUE(verify_take(path("packed"), decoding).is_intact());
}

TEST_P(PackTemporalTest, PartsOfACameraAreWholeGroups) {
  TemporalOptions parts = options();
  parts.frames_at_once = 1;
  const TemporalReport report = pack_temporal(Take(path("take")), path("packed"), parts);
  EXPECT_EQ(report.total().groups, kRow * 3);
  const Take source(path("take")), packed(path("packed"));
  ASSERT_EQ(packed.archive(1).records().size(), source.archive(1).records().size());
  for (int frame = 0; frame < kPictures; ++frame) {
    EXPECT_EQ(is_key_frame(packed.archive(1).stored(frame)), frame % kGroup == 0) << frame;
    EXPECT_GT(psnr_between(source.archive(1).jpeg(frame), packed.archive(1).jpeg(frame)), 30);
  }
}

TEST_P(PackTemporalTest, AnyOrderOfReadingGivesTheSamePictures) {
  pack();
  std::vector<Bytes> in_order;
  {
    const Take take(path("packed"));
    for (int frame = 0; frame < kPictures; ++frame) {
      const FrameBytes jpeg = take.archive(0).jpeg(frame);
      in_order.emplace_back(jpeg.begin(), jpeg.end());
    }
  }
  for (const std::size_t budget : {std::size_t{0}, std::size_t{1} << 26}) {
    const Take take(path("packed"));
    take.unpacked_frames().set_budget(budget);
    std::vector<int> order(kPictures);
    for (int i = 0; i < kPictures; ++i) order[static_cast<std::size_t>(i)] = i;
    std::shuffle(order.begin(), order.end(), std::mt19937(3));
    for (const int frame : order) {
      EXPECT_TRUE(std::ranges::equal(take.archive(0).jpeg(frame),
                                     in_order[static_cast<std::size_t>(frame)]))
          << frame;
    }
  }
}

TEST_P(PackTemporalTest, OtherProgramsCountFramesAndReadTimes) {
  pack();
  const std::string file = (path("packed") / "archive" / "c0.mkv").string();
  const std::string counted = output_of({"ffprobe", "-v", "error", "-count_frames", "-show_entries",
                                         "stream=nb_read_frames", "-of", "csv=p=0", file});
  EXPECT_THAT(counted, HasSubstr(std::to_string(kPictures)));
  const std::string packets = output_of(
      {"ffprobe", "-v", "error", "-show_entries", "packet=pts,flags", "-of", "csv=p=0", file});
  std::string expected;
  for (int i = 0; i < kPictures; ++i) {
    expected += std::to_string(time_of(i)) + (i % kGroup == 0 ? ",K_" : ",__") + "\n";
  }
  EXPECT_EQ(packets, expected);
}

TEST_P(PackTemporalTest, WithoutReferencesEveryFrameIsAGroup) {
  const TemporalReport report = pack(1);
  EXPECT_EQ(report.total().groups, kRow * kPictures);
  EXPECT_FALSE(Take(path("packed")).archive(1).is_rotten(7));
}

TEST_P(PackTemporalTest, HevcKeepsFullChroma) {
  const TemporalReport report = pack();  // of JPEGs in 4:4:4
  const bool is_444 = GetParam() == VideoCodec::kHevc;
  EXPECT_EQ(report.total().frames_in_444, is_444 ? kRow * kPictures : 0);
  const Take packed(path("packed"));
  EXPECT_EQ(chroma_of_jpeg(packed.archive(0).jpeg(5), "decoded"),
            is_444 ? ChromaStep::k444 : ChromaStep::k420);
}

TEST_P(PackTemporalTest, FlippedBitsAreFound) {
  pack();
  const fs::path file = path("packed") / "archive" / "c0.mkv";
  const Bytes whole = testing::bytes_of(file);
  std::mt19937 random(7);
  for (int i = 0; i < 40; ++i) {
    Bytes bytes = whole;
    const std::size_t at = i < 20 ? static_cast<std::size_t>(i) * 22 : random() % bytes.size();
    bytes[at] ^= static_cast<std::byte>(1U << (random() % 8));
    testing::overwrite(file, bytes);
    EXPECT_FALSE(verify_take(path("packed"), {}).is_intact()) << at;
  }
}

TEST_P(PackTemporalTest, DamageCostsTheRestOfItsGroupOnly) {
  pack();
  const fs::path file = path("packed") / "archive" / "c0.mkv";
  Bytes bytes = testing::bytes_of(file);
  constexpr int kDamaged = kGroup + 1;
  bytes[Take(path("packed")).archive(0).frames()[kDamaged].offset + 70] ^= std::byte{4};
  testing::overwrite(file, bytes);
  const auto expect_rest_lost = [&](const Take& take, int first, int end) {
    for (int frame = 0; frame < static_cast<int>(take.archive(0).frames().size()); ++frame) {
      const bool is_lost = frame >= first && frame < end;
      EXPECT_EQ(take.archive(0).is_rotten(frame), is_lost) << frame;
      EXPECT_EQ(take.archive(0).intact_jpeg(frame).has_value(), !is_lost) << frame;
      if (is_lost) {
        EXPECT_THROW(take.archive(0).jpeg(frame), RottenFrame);
      }
    }
  };
  expect_rest_lost(Take(path("packed")), kDamaged, 2 * kGroup);
  TakeVerifyOptions decoding;
  decoding.decode = true;
  std::set<std::int64_t> named;
  const TakeFixityReport report = verify_take(path("packed"), decoding);
  for (const FixityProblem& problem : report.cameras.at(0).report.problems) {
    for (const AffectedFrame& frame : problem.frames) named.insert(frame.number);
  }
  std::set<std::int64_t> rest;
  for (int frame = kDamaged; frame < 2 * kGroup; ++frame) rest.insert(frame);
  EXPECT_EQ(named, rest);
  // Links say the same without decoding.
  const auto undecodable = [&] {
    std::set<std::int64_t> numbers;
    const TakeFixityReport found = verify_take(path("packed"), {});
    for (const AffectedFrame& frame : found.cameras.at(0).undecodable_frames) {
      numbers.insert(frame.number);
    }
    EXPECT_TRUE(found.cameras.at(1).undecodable_frames.empty());
    return numbers;
  };
  EXPECT_EQ(undecodable(), (std::set<std::int64_t>{kDamaged + 1, kDamaged + 2}));
  // Repaired, the frame is a gap, and those that refer to it are never decoded from another.
  repair_take(path("packed"), {});
  const Take repaired(path("packed"));
  ASSERT_EQ(repaired.archive(0).frames().size(), kPictures - 1);
  expect_rest_lost(repaired, kDamaged, 2 * kGroup - 1);
  EXPECT_TRUE(verify_take(path("packed"), {}).is_intact());
  EXPECT_EQ(undecodable(), (std::set<std::int64_t>{kDamaged, kDamaged + 1}));
  EXPECT_FALSE(verify_take(path("packed"), decoding).is_intact());
}

TEST_P(PackTemporalTest, AFrameThatCannotBeDecodedCostsNoneBeforeIt) {
  pack();
  constexpr std::size_t kFault = 2;
  const Take whole(path("packed"));
  {
    TakeWriter writer(path("faulty"), whole.document(), schemas::read_rig(whole.file("rig.json")),
                      whole.archive(0).description().codec);
    for (int camera = 0; camera < kRow; ++camera) {
      const ArchiveReader& archive = whole.archive(camera);
      for (std::size_t i = 0; i < archive.frames().size(); ++i) {
        const FrameBytes bytes = archive.stored(static_cast<int>(i));
        const FrameLink link = read_frame_link(bytes).value();
        const Bytes nonsense(300, std::byte{0x5a});
        FrameRecord record = archive.frames()[i];
        if (i == kFault) {
          writer.archive(camera).append_again(record,
                                              make_temporal_frame(GetParam(), link, nonsense));
        } else {
          writer.archive(camera).append_again(record, bytes);
        }
      }
    }
    writer.commit();
  }
  const Take faulty(path("faulty"));
  for (std::size_t i = 0; i < 2 * kGroup; ++i) {
    EXPECT_EQ(faulty.archive(0).intact_jpeg(static_cast<int>(i)).has_value(),
              i < kFault || i >= kGroup)
        << i;
  }
  TakeVerifyOptions decoding;
  decoding.decode = true;
  const TakeFixityReport report = verify_take(path("faulty"), decoding);
  for (const FixityProblem& problem : report.cameras.at(0).report.problems) {
    for (const AffectedFrame& frame : problem.frames) {
      EXPECT_TRUE(frame.number >= static_cast<int>(kFault) && frame.number < kGroup);
    }
  }
  EXPECT_FALSE(report.is_intact());
}

TEST_P(PackTemporalTest, WhatCannotBeDoneIsRefusedAndNothingRemains) {
  pack();
  const Take packed(path("packed"));
  EXPECT_THROW(pack_temporal(packed, path("again"), options()), Error);
  EXPECT_THROW(pack_take(packed, path("again"), {}), Error);
  EXPECT_THROW(unpack_take(packed, path("again"), {}), Error);
  EXPECT_THROW(pack(), Error);  // it exists
  ArchiveWriter::Description description = packed.archive(0).description();
  description.codec = FrameCodec::kJpeg;  // as recorders describe it
  EXPECT_THROW(ArchiveWriter::resume(path("packed") / "archive" / "c0.mkv",
                                     path("packed") / "archive" / "c0.journal", description),
               Error);
  std::stop_source stop;
  stop.request_stop();
  TemporalOptions stopped = options();
  stopped.stop = stop.get_token();
  EXPECT_THROW(pack_temporal(Take(path("take")), path("again"), stopped), Error);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 2);
}

TEST_P(PackTemporalTest, AnExcerptHasTheFramesOfItsTime) {
  Excerpt excerpt{time_of(3), time_of(6), options().video, {1}};
  write_excerpt(Take(path("take")), path("part"), excerpt, {});
  const Take part(path("part")), source(path("take"));
  for (int camera = 0; camera < kRow; ++camera) {
    const ArchiveReader &from = source.archive(camera), &to = part.archive(camera);
    ASSERT_EQ(to.frames().size(), 4);
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(to.frames()[i].time_ns, time_of(i + 3));
      const bool is_same = std::ranges::equal(to.jpeg(i), from.jpeg(i + 3));
      EXPECT_EQ(is_same, camera == 1);  // which is not encoded
      EXPECT_GT(psnr_between(to.jpeg(i), from.jpeg(i + 3)), 30);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, PackTemporalTest,
                         ::testing::Values(VideoCodec::kHevc, VideoCodec::kAv1),
                         [](const auto& test) { return std::string(name_of(test.param)); });

}  // namespace
}  // namespace raystage::store
