// SPDX-License-Identifier: Apache-2.0
#include "store/temporal/temporal_frame.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/resources.h"
#include "store/jpeg/encode.h"
#include "store/temporal/group_decoder.h"
#include "store/temporal/planes.h"
#include "testing/child_limits.h"

namespace raystage::store {
namespace {

using Bytes = std::vector<std::byte>;

TEST(TemporalFrame, AFrameStatesItsLink) {
  const Bytes packet{std::byte{0x12}, std::byte{0}, std::byte{0x0a}, std::byte{7}};
  for (const VideoCodec codec : {VideoCodec::kHevc, VideoCodec::kAv1}) {
    for (const FrameLink link : {FrameLink{0, 0, 0, 0}, FrameLink{3, 0xfedc'ba98'7654'3210, 77, 1},
                                 FrameLink{255, ~std::uint64_t{0}, ~std::uint32_t{0}, 5}}) {
      const Bytes frame = make_temporal_frame(codec, link, packet);
      EXPECT_EQ(read_frame_link(frame), link);
      EXPECT_EQ(is_key_frame(frame), link.position == 0);
      EXPECT_EQ(frame.back(), packet.back());
      // The start code is the only one of the link: HEVC needs no escapes.
      for (std::size_t i = 4; i + packet.size() < frame.size(); ++i) {
        EXPECT_TRUE(codec == VideoCodec::kAv1 || frame[i] != std::byte{0});
      }
      EXPECT_FALSE(read_frame_link(std::span(frame).first(40)));
    }
  }
}

/// A rig states any size.
TEST(GroupDecoder, HugeCamerasGrantNoMoreThanHalfOfTheMachine) {
  const GroupDecoder decoder;
  const Bytes garbage(100, std::byte{3});
  const std::vector<std::span<const std::byte>> frames(256, garbage);
  EXPECT_THROW(decoder.decode(VideoCodec::kHevc, {65535, 65535}, frames, "a"), Error);
  if (!testing::kDecodersHaveLimits) GTEST_SKIP() << "decoders have no limits in this build";
  const std::uint64_t limit = testing::largest_data_limit_of_decoders();
  EXPECT_GT(limit, kMaxGroupBytes);
  EXPECT_LT(limit, available_memory() / 2 + (std::uint64_t{1} << 30));
}

TEST(TemporalFrame, OtherBytesHaveNoLink) {
  EXPECT_FALSE(read_frame_link({}));
  const Bytes jpeg{std::byte{0xff}, std::byte{0xd8}, std::byte{0xff}, std::byte{0xe0}};
  EXPECT_FALSE(read_frame_link(jpeg));
  EXPECT_TRUE(is_key_frame(jpeg));
  Bytes frame = make_temporal_frame(VideoCodec::kHevc, {256, 0, 0, 0}, jpeg);
  EXPECT_FALSE(read_frame_link(frame));  // no group is so long
  frame = make_temporal_frame(VideoCodec::kAv1, {1, 0, 0, 0}, jpeg);
  frame[18] ^= std::byte{2};  // the version
  EXPECT_FALSE(read_frame_link(frame));
}

TEST(Planes, FullChromaIsKept) {
  RgbImage image;
  image.width = 75;
  image.height = 53;
  for (int i = 0; i < 75 * 53 * 3; ++i) {
    image.values.push_back(static_cast<std::uint8_t>(i * i / 7 % 97 + i % 75));
  }
  JpegEncodeOptions options;
  options.chroma = JpegEncodeOptions::Chroma::k420;
  EXPECT_EQ(chroma_of_jpeg(encode_jpeg(image, options), "420"), ChromaStep::k420);
  options.chroma = JpegEncodeOptions::Chroma::k444;
  const std::vector<std::byte> jpeg = encode_jpeg(image, options);
  EXPECT_EQ(chroma_of_jpeg(jpeg, "444"), ChromaStep::k444);
  const Planes first = planes_of_jpeg(jpeg, 75, 53, "first", ChromaStep::k444);
  PlanesView view;
  view.chroma = ChromaStep::k444;
  for (std::size_t c = 0; c < 3; ++c) {
    view.plane[c] = first.plane[c].data();
    view.stride[c] = 80;
  }
  const std::vector<std::byte> again = jpeg_of_planes(view, 75, 53);
  EXPECT_EQ(chroma_of_jpeg(again, "again"), ChromaStep::k444);
  const Planes second = planes_of_jpeg(again, 75, 53, "second", ChromaStep::k444);
  EXPECT_LT(mean_square_error(first, second, 75, 53), 0.12);  // 57 dB
}

TEST(Planes, AJpegOfPlanesDiffersByRoundingOnly) {
  RgbImage image;
  image.width = 75;  // odd: neither MCUs nor coded picture are whole
  image.height = 53;
  for (int i = 0; i < 75 * 53 * 3; ++i) {
    image.values.push_back(static_cast<std::uint8_t>(i * i / 7 % 97 + i % 75));
  }
  JpegEncodeOptions subsampled;
  subsampled.chroma = JpegEncodeOptions::Chroma::k420;
  const Planes first = planes_of_jpeg(encode_jpeg(image, subsampled), 75, 53, "first");
  EXPECT_EQ(first.width, 80);
  EXPECT_EQ(first.height, 64);
  PlanesView view;
  for (std::size_t c = 0; c < 3; ++c) {
    view.plane[c] = first.plane[c].data();
    view.stride[c] = c == 0 ? 80 : 40;
  }
  const Planes second = planes_of_jpeg(jpeg_of_planes(view, 75, 53), 75, 53, "second");
  EXPECT_GT(mean_square_error(first, second, 75, 53), 0);
  EXPECT_LT(mean_square_error(first, second, 75, 53), 0.12);  // 57 dB
  EXPECT_THROW(planes_of_jpeg(encode_jpeg(image, {}), 80, 53, "wrong size"), std::exception);
}

}  // namespace
}  // namespace raystage::store
