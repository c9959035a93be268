// SPDX-License-Identifier: Apache-2.0
#include "store/packing/pack_take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "base/atomic_file.h"
#include "base/error.h"
#include "schemas/rig_document.h"
#include "store/fixity/manifest.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/jpeg/encode.h"
#include "store/rotten_frame.h"
#include "store/stored_frames.h"
#include "store/take_summary.h"
#include "store/timeline.h"
#include "store/timeline_file.h"
#include "testing/store/take_test_data.h"
#include "testing/store/test_encoder.h"

namespace raystage::store {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Bytes = std::vector<std::byte>;

constexpr int kCameras = 3, kFrames = 5;

RgbImage smooth_picture(unsigned seed) {
  std::mt19937 random(seed);
  RgbImage image;
  image.width = 320;
  image.height = 240;
  image.values.resize(std::size_t{320} * 240 * 3);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = static_cast<std::uint8_t>(
        (i / 3 % 320 + i / 960 * (i % 3) + seed * 40 + random() % 8) % 256);
  }
  return image;
}

TakeVerifyOptions decoding() {
  TakeVerifyOptions options;
  options.decode = true;
  return options;
}

RepairOptions from_copy(const fs::path& copy) {
  RepairOptions options;
  options.copy = copy;
  return options;
}

class PackTakeTest : public ::testing::Test {
 protected:
  void SetUp() override {
    TakeWriter writer(path("take"), testing::take_document(kCameras),
                      testing::rig_document(kCameras));
    testing::JpegVariant arithmetic, progressive;
    arithmetic.arithmetic = true;
    progressive.progressive = true;
    for (int camera = 0; camera < kCameras; ++camera) {
      ArchiveWriter& out = writer.archive(camera);
      for (unsigned i = 0; i < kFrames; ++i) {
        const unsigned seed = i + 10 * static_cast<unsigned>(camera);
        Bytes jpeg = encode_jpeg(smooth_picture(seed), {});
        if (camera == 1 && i == 1)
          jpeg = testing::encode_jpeg_variant(smooth_picture(seed), arithmetic);
        if (camera == 1 && i == 2)
          jpeg = testing::encode_jpeg_variant(smooth_picture(seed), progressive);
        if (camera == 2 && i == 3) jpeg = testing::fake_jpeg(9, 3000);
        if (camera == 2 && i == 4) jpeg.resize(jpeg.size() / 2);
        const Nanoseconds time = 1000 * (i + 1);
        out.append_again({time, 0, 0, FrameStatus::kStored, 0, time + 7, i, i == 2}, jpeg);
        if (i == 3) out.append_missing(FrameStatus::kDroppedLate, time + 5, {time + 9, i});
      }
    }
    write_file_atomically(writer.working_folder() / "views.json", "{}");
    writer.finish();
    write_timeline(build_timeline(Take(writer.working_folder()), 1e6, 0), writer.working_folder());
    create_folder(writer.working_folder() / "depth");
    write_file_atomically(writer.working_folder() / "depth" / "derived", "x");
    writer.commit();
    const Take take(path("take"));
    write_file_atomically(path("take") / kManifestFile, manifest_as_text(make_manifest(take, {})));
  }
  fs::path path(const std::string& name) const { return folder_.path() / name; }
  PackReport pack() const { return pack_take(Take(path("take")), path("packed"), {}); }
  static std::map<std::string, Bytes> files_below(const fs::path& folder) {
    std::map<std::string, Bytes> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (!entry.is_regular_file()) continue;
      files[entry.path().lexically_relative(folder).string()] = testing::bytes_of(entry.path());
    }
    return files;
  }

  testing::TestFolder folder_;
};

TEST_F(PackTakeTest, UnpackingReturnsTheSameFiles) {
  const auto before = files_below(path("take"));
  const PackReport packed = pack();
  const PackReport::Camera total = packed.total();
  EXPECT_EQ(packed.status, RunStatus::kFinished);
  EXPECT_EQ(total.frames, kCameras * kFrames);
  EXPECT_EQ(total.packed, kCameras * kFrames - 3);
  EXPECT_LT(total.bytes_after, total.bytes_before);
  EXPECT_EQ(packed.cameras[0].packed, kFrames);
  EXPECT_TRUE(packed.cameras[0].refusals.empty());
  std::int64_t refused = 0;
  for (const auto& [why, count] : total.refusals) refused += count;
  EXPECT_EQ(refused, 3);
  EXPECT_TRUE(files_below(path("take")) == before);
  EXPECT_FALSE(fs::exists(path("packed") / kManifestFile));
  EXPECT_FALSE(fs::exists(path("packed") / "depth"));

  const PackReport unpacked = unpack_take(Take(path("packed")), path("again"), {});
  EXPECT_EQ(unpacked.total().packed, kCameras * kFrames - 3);
  EXPECT_EQ(unpacked.total().bytes_after, total.bytes_before);
  auto expected = before;
  expected.erase("depth/derived");
  const auto again = files_below(path("again"));
  EXPECT_EQ(again.size(), expected.size());
  for (const auto& [name, bytes] : expected) {
    EXPECT_TRUE(again.contains(name) && again.at(name) == bytes) << name;
  }
  const auto manifest = check_manifest(path("again"), read_manifest(path("again")), {});
  EXPECT_TRUE(manifest.is_intact());
}

TEST_F(PackTakeTest, PackedTakesReadLikeTheirSources) {
  pack();
  const Take source(path("take")), packed(path("packed"));
  for (int camera = 0; camera < kCameras; ++camera) {
    const ArchiveReader& a = source.archive(camera);
    const ArchiveReader& b = packed.archive(camera);
    EXPECT_EQ(read_timeline(packed).ticks.size(), read_timeline(source).ticks.size());
    EXPECT_EQ(b.description().codec, FrameCodec::kPacked);
    ASSERT_EQ(a.records().size(), b.records().size());
    for (std::size_t i = 0; i < a.records().size(); ++i) {
      FrameRecord record = b.records()[i];
      record.offset = a.records()[i].offset;
      record.size = a.records()[i].size;
      record.xxh3 = a.records()[i].xxh3;
      EXPECT_EQ(record, a.records()[i]);
    }
    for (int frame = 0; frame < kFrames; ++frame) {
      EXPECT_FALSE(b.is_rotten(frame));
      EXPECT_EQ(b.jpeg_xxh3(frame), a.frames()[frame].xxh3);
      EXPECT_TRUE(std::ranges::equal(a.jpeg(frame), b.jpeg(frame)));
      EXPECT_TRUE(std::ranges::equal(a.jpeg(frame), b.jpeg(frame)));  // from the cache
      EXPECT_TRUE(b.verify_frame(frame));
      const bool is_refused = (camera == 1 && frame == 1) || (camera == 2 && frame >= 3);
      EXPECT_EQ(b.is_packed(frame), !is_refused);
    }
  }
  EXPECT_GT(packed.unpacked_frames().bytes_held(), 0);
  packed.unpacked_frames().set_budget(1);
  EXPECT_EQ(packed.unpacked_frames().bytes_held(), 0);
  EXPECT_TRUE(std::ranges::equal(source.archive(0).jpeg(0), packed.archive(0).jpeg(0)));
  const TakeSummary summary = summarise_take(packed);
  EXPECT_TRUE(summary.cameras[0].packed);
  EXPECT_EQ(summary.cameras[0].packed_frames, kFrames);
  EXPECT_EQ(summary.cameras[1].packed_frames, kFrames - 1);  // one of arithmetic coding
  EXPECT_EQ(summary.cameras[2].packed_frames, kFrames - 2);  // one is no JPEG, one is cut off
  EXPECT_EQ(summary.cameras[0].restart_markers, std::nullopt);
  EXPECT_FALSE(summarise_take(source).cameras[0].packed);
  EXPECT_EQ(source.unpacked_frames().bytes_held(), 0);
}

TEST_F(PackTakeTest, WithoutAJournalFramesAreStillChecked) {
  pack();
  fs::remove(path("packed") / "archive" / "c0.journal");
  const Take source(path("take")), packed(path("packed"));
  for (int frame = 0; frame < kFrames; ++frame) {
    EXPECT_EQ(packed.archive(0).frames()[frame].xxh3, 0);
    EXPECT_TRUE(std::ranges::equal(source.archive(0).jpeg(frame), packed.archive(0).jpeg(frame)));
  }
  const std::uint64_t offset = packed.archive(0).frames()[2].offset;
  Bytes bytes = testing::bytes_of(path("packed") / "archive" / "c0.mkv");
  bytes[offset + 500] ^= std::byte{1};
  testing::overwrite(path("packed") / "archive" / "c0.mkv", bytes);
  const Take damaged(path("packed"));
  EXPECT_THROW(damaged.archive(0).jpeg(2), RottenFrame);
  EXPECT_TRUE(damaged.archive(0).is_rotten(2));
}

TEST_F(PackTakeTest, VerifyFindsEveryFlippedBit) {
  pack();
  ASSERT_TRUE(verify_take(path("packed"), {}).is_intact());
  const fs::path file = path("packed") / "archive" / "c0.mkv";
  const Bytes whole = testing::bytes_of(file);
  std::mt19937 random(7);
  for (int i = 0; i < 60; ++i) {
    Bytes bytes = whole;
    // The header first, where the codec is; then everywhere.
    const std::size_t at = i < 30 ? static_cast<std::size_t>(i) * 15 : random() % bytes.size();
    bytes[at] ^= static_cast<std::byte>(1U << (random() % 8));
    testing::overwrite(file, bytes);
    EXPECT_FALSE(verify_take(path("packed"), {}).is_intact()) << at;
  }
  testing::overwrite(file, whole);
  EXPECT_TRUE(verify_take(path("packed"), {}).is_intact());
}

TEST_F(PackTakeTest, DecodingVerifiesTheOriginals) {
  // Without the frames that no JPEG decoder accepts.
  TakeWriter writer(path("good"), testing::take_document(1), testing::rig_document(1));
  for (unsigned i = 0; i < 3; ++i) {
    writer.archive(0).append(encode_jpeg(smooth_picture(i), {}), i + 1);
  }
  writer.commit();
  pack_take(Take(path("good")), path("good_packed"), {});
  EXPECT_TRUE(verify_take(path("good_packed"), decoding()).is_intact());

  // A packed frame that the journal confirms, but whose JPEG is another: made to do harm.
  const Take packed(path("good_packed"));
  const FrameBytes first = packed.archive(0).jpeg(0);
  const FrameRecord record = packed.archive(0).frames()[0];
  Bytes bytes = testing::bytes_of(path("good_packed") / "archive" / "c0.mkv");
  Bytes frame(bytes.begin() + static_cast<long>(record.offset),
              bytes.begin() + static_cast<long>(record.offset + record.size));
  frame[60] ^= std::byte{1};  // the XXH3 that it states
  TakeWriter forged(path("forged"), testing::take_document(1), testing::rig_document(1),
                    FrameCodec::kPacked);
  forged.archive(0).append(frame, 1);
  forged.commit();
  EXPECT_TRUE(verify_take(path("forged"), {}).is_intact());
  EXPECT_FALSE(verify_take(path("forged"), decoding()).is_intact());
  EXPECT_THROW(Take(path("forged")).archive(0).jpeg(0), RottenFrame);
}

TEST_F(PackTakeTest, ATakeMayBePackedAgain) {
  pack();
  const Take packed(path("packed"));
  write_file_atomically(path("packed") / kManifestFile,
                        manifest_as_text(make_manifest(packed, {})));
  PackOptions options;
  options.effort = 9;
  const PackReport report = pack_take(packed, path("smaller"), options);
  EXPECT_LT(report.total().bytes_after, report.total().bytes_before);
  EXPECT_EQ(report.total().packed, kCameras * kFrames - 3);
  unpack_take(Take(path("smaller")), path("again"), {});
  EXPECT_EQ(testing::bytes_of(path("again") / kManifestFile),
            testing::bytes_of(path("take") / kManifestFile));
  EXPECT_EQ(testing::bytes_of(path("again") / "archive" / "c1.mkv"),
            testing::bytes_of(path("take") / "archive" / "c1.mkv"));
}

TEST_F(PackTakeTest, RepairKeepsTheForm) {
  pack();
  const fs::path file = path("packed") / "archive" / "c0.mkv";
  const Bytes whole = testing::bytes_of(file);
  Bytes bytes = whole;
  bytes[10] ^= std::byte{4};                // the header
  bytes[bytes.size() - 9] ^= std::byte{4};  // the Cues
  testing::overwrite(file, bytes);
  repair_take(path("packed"), {});
  EXPECT_EQ(testing::bytes_of(file), whole);

  // From a copy: of the same form only.
  fs::copy(path("packed"), path("copy"), fs::copy_options::recursive);
  bytes = whole;
  bytes[Take(path("packed")).archive(0).frames()[1].offset + 100] ^= std::byte{1};
  testing::overwrite(file, bytes);
  const RepairReport wrong = repair_take(path("packed"), from_copy(path("take")));
  EXPECT_THAT(wrong.cameras[0].error, HasSubstr("different forms"));
  EXPECT_EQ(testing::bytes_of(file), bytes);
  const RepairReport right = repair_take(path("packed"), from_copy(path("copy")));
  EXPECT_EQ(right.cameras[0].frames_from_copy, 1);
  EXPECT_EQ(testing::bytes_of(file), whole);
}

TEST_F(PackTakeTest, APackedArchiveMayBeContinued) {
  pack();
  const Take source(path("take"));
  const Bytes jpeg = encode_jpeg(smooth_picture(77), {});
  ArchiveWriter::Description description = source.archive(0).description();
  ASSERT_EQ(description.codec, FrameCodec::kJpeg);  // as recorders describe it
  {
    ArchiveWriter out =
        ArchiveWriter::resume(path("packed") / "archive" / "c0.mkv",
                              path("packed") / "archive" / "c0.journal", description);
    out.append(jpeg, 50'000);
    out.close();
  }
  const Take packed(path("packed"));
  EXPECT_TRUE(std::ranges::equal(packed.archive(0).jpeg(kFrames), jpeg));
  EXPECT_TRUE(std::ranges::equal(packed.archive(0).jpeg(0), source.archive(0).jpeg(0)));
  fs::remove(path("packed") / kTimelineFile);  // of fewer frames
  EXPECT_TRUE(verify_take(path("packed"), {}).is_intact());
}

TEST_F(PackTakeTest, StoredFramesAreTheBytesOfTheFile) {
  pack();
  const fs::path file = path("packed") / "archive" / "c1.mkv";
  Bytes bytes = testing::bytes_of(file);
  const Take packed(path("packed"));
  const auto records = packed.archive(1).frames();
  for (const FrameRecord& record : records) {
    const FrameBytes stored = StoredFrames(file).read(record);
    EXPECT_TRUE(
        std::ranges::equal(stored.bytes(), std::span(bytes).subspan(record.offset, record.size)));
  }
  bytes[records[2].offset + 100] ^= std::byte{1};
  testing::overwrite(file, bytes);
  EXPECT_THROW(StoredFrames(file).read(records[2]), Error);
  EXPECT_NO_THROW(StoredFrames(file).read(records[1]));
}

TEST_F(PackTakeTest, DamagedSourcesAreRefusedAndNothingRemains) {
  const fs::path file = path("take") / "archive" / "c1.mkv";
  const Bytes whole = testing::bytes_of(file);
  Bytes bytes = whole;
  bytes[Take(path("take")).archive(1).frames()[4].offset + 100] ^= std::byte{1};
  testing::overwrite(file, bytes);
  EXPECT_THROW(pack(), RottenFrame);
  testing::overwrite(file, whole);
  fs::rename(path("take") / "archive" / "c1.journal", path("journal"));
  EXPECT_THROW(pack(), Error);
  fs::rename(path("journal"), path("take") / "archive" / "c1.journal");
  bytes = whole;
  bytes.resize(bytes.size() - 10);  // not closed
  testing::overwrite(file, bytes);
  EXPECT_THROW(pack(), Error);
  testing::overwrite(file, whole);

  std::stop_source stop;
  stop.request_stop();
  PackOptions stopped;
  stopped.stop = stop.get_token();
  EXPECT_THROW(pack_take(Take(path("take")), path("packed"), stopped), Error);
  EXPECT_THROW(unpack_take(Take(path("take")), path("packed"), {}), Error);
  EXPECT_THROW(pack_take(Take(path("take")), path("take") / "inside", {}), Error);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 1);
  pack();
  EXPECT_THROW(pack(), Error);  // it exists
}

TEST_F(PackTakeTest, LinksInTheSourceAreRefused) {
  fs::create_symlink("/etc/hostname", path("take") / "notes");
  EXPECT_THROW(pack(), Error);
  EXPECT_FALSE(fs::exists(path("packed")));
}

}  // namespace
}  // namespace raystage::store
