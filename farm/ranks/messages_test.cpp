// SPDX-License-Identifier: Apache-2.0
#include "farm/ranks/messages.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <utility>

#include "base/error.h"
#include "farm/ranks/message_checks.h"
#include "farm/ranks/mpi_world.h"
#include "farm/ranks/rank_takes.h"
#include "store/jpeg/encode.h"
#include "testing/store/test_images.h"

namespace raystage::farm {
namespace {

MessageBytes bytes_of(std::initializer_list<int> values) {
  MessageBytes bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

store::JpegLayout layout_of(int restart_interval) {
  const auto jpeg =
      store::encode_jpeg(testing::make(testing::Kind::kMixed, 131, 75),
                         {90, store::JpegEncodeOptions::Chroma::k420, restart_interval});
  return store::parse_jpeg_layout(jpeg, "x");
}

FrameReply with(store::JpegLayout layout) {
  FrameReply reply;
  reply.layout = std::move(layout);
  return reply;
}

TEST(RankMessages, NestedTooDeeplyAreDamaged) {
  for (const int start : {0x81, 0xA1, 0x9F, 0x5F, 0x7F, 0xC1}) {  // arrays, maps, strings, tags
    MessageBytes message(8 + 1'000'000, static_cast<std::byte>(start));
    const std::uint64_t size = message.size() - 8;
    std::memcpy(message.data(), &size, sizeof(size));
    EXPECT_THROW(decode_request(message), Error) << start;
    EXPECT_THROW(decode_frame_request(message), Error) << start;
  }
}

TEST(RankMessages, CborOfFewLevelsIsParsed) {
  EXPECT_TRUE(is_shallow_cbor({}));
  EXPECT_TRUE(
      is_shallow_cbor(bytes_of({0x83, 0x80, 0xA1, 0x61, 'a', 0x18, 200, 0x42, 0xFF, 0xFF})));
  EXPECT_TRUE(is_shallow_cbor(bytes_of({0xF9, 0x80, 0x81})));  // a double of 16 bits
  // Many containers next to each other.
  MessageBytes wide = bytes_of({0x99, 0xFF, 0xFF});
  for (int i = 0; i < 0xFFFF; ++i) wide.insert(wide.end(), {std::byte{0x81}, std::byte{0x80}});
  EXPECT_TRUE(is_shallow_cbor(wide));
  MessageBytes deep(16, std::byte{0x81});
  deep.push_back(std::byte{0});
  EXPECT_TRUE(is_shallow_cbor(deep));
  deep.insert(deep.begin(), std::byte{0x81});
  EXPECT_FALSE(is_shallow_cbor(deep));
  EXPECT_FALSE(is_shallow_cbor(bytes_of({0x82, 0x80})));  // more items than bytes
  EXPECT_FALSE(is_shallow_cbor(bytes_of({0x64, 'a'})));
  EXPECT_FALSE(is_shallow_cbor(bytes_of({0x19, 1})));
}

TEST(RankMessages, LayoutsOfFramesAreThoseThatTheParserReturns) {
  for (const int interval : {0, 1, 4}) {
    const store::JpegLayout sent = layout_of(interval);
    const auto received = decode_frame_reply(encode(with(sent))).layout;
    ASSERT_TRUE(received);
    EXPECT_EQ(received->segment_offset, sent.segment_offset);
    EXPECT_EQ(received->scan_end, sent.scan_end);
    EXPECT_EQ(received->restart_interval, interval);
  }
  EXPECT_FALSE(decode_frame_reply(encode(FrameReply{})).layout);
}

TEST(RankMessages, LayoutsThatDecodersCannotRelyOnAreDamaged) {
  using Layout = store::JpegLayout;
  const std::function<void(Layout&)> damages[] = {
      [](Layout& l) { l.restart_interval = 0; },
      [](Layout& l) { l.restart_interval = -4; },
      [](Layout& l) { l.segment_offset.pop_back(); },
      [](Layout& l) { l.segment_offset.clear(); },
      [](Layout& l) { std::swap(l.segment_offset[1], l.segment_offset[2]); },
      [](Layout& l) { l.segment_offset[1] = l.segment_offset[0]; },
      [](Layout& l) { l.scan_end = std::size_t{1} << 60; },
      [](Layout& l) { --l.scan_end; },
      [](Layout& l) { ++l.scan_offset; },
      [](Layout& l) { l.sof_offset = l.scan_offset; },
      [](Layout& l) { l.width = 0; },
      [](Layout& l) { l.height = 1 << 30; },
      [](Layout& l) { l.components = 4; },
      [](Layout& l) { l.h[1] = 0; },
      [](Layout& l) { l.v[0] = 5; },
      [](Layout& l) { l.mcu_width = 8; },
      [](Layout& l) { ++l.mcus_per_row; },
      [](Layout& l) { l.mcu_rows = 0; },
      [](Layout& l) { l.baseline_ycc = false; },
      [](Layout& l) {  // more bytes than its blocks can take
        l.segment_offset.back() = 4'000'000'000;
        l.scan_end = l.segment_offset.back() - 2;
      },
  };
  for (std::size_t i = 0; i < std::size(damages); ++i) {
    store::JpegLayout layout = layout_of(4);
    damages[i](layout);
    EXPECT_THROW(decode_frame_reply(encode(with(layout))), Error) << i;
  }
}

TEST(RankMessages, RequestsForFramesNeedATagForTheReply) {
  FrameRequest request;
  request.reply_tag = kFirstReplyTag;
  request.segments = {0, 3};
  EXPECT_EQ(decode_frame_request(encode(request)).segments, request.segments);
  request.reply_tag = kFrameRequestTag;
  EXPECT_THROW(decode_frame_request(encode(request)), Error);
}

// Its sender would wait for a reply without end. MPI accepts a process that is started alone.
TEST(FrameServiceDeathTest, ADamagedRequestEndsTheJobWithTheReason) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "MPI keeps memory and has locks of its own";
#endif
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto send_requests = [] {
    MpiWorld world(nullptr, nullptr);
    const FrameService service(world);
    FrameRequest request;  // of a take that was never opened
    request.reply_tag = kFirstReplyTag;
    world.send(0, kFrameRequestTag, encode(request));
    const FrameReply reply = decode_frame_reply(world.receive(0, kFirstReplyTag));
    if (reply.error.empty()) return;
    world.send(0, kFrameRequestTag, MessageBytes(3));
    world.receive(0, kFirstReplyTag);
  };
  EXPECT_EXIT(send_requests(), ::testing::ExitedWithCode(1), "rank 0: .*damaged");
}

}  // namespace
}  // namespace raystage::farm
