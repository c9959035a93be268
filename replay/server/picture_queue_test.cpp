// SPDX-License-Identifier: Apache-2.0
#include "replay/server/picture_queue.h"

#include <gtest/gtest.h>

namespace raystage::replay {
namespace {

constexpr int kViews = 0, kThumbnails = 5;

std::vector<std::byte> picture(int number) { return {static_cast<std::byte>(number)}; }

TEST(PictureQueue, ANewerPictureReplacesTheOneThatWaits) {
  PictureQueue queue;
  queue.push(kViews, 1, picture(1));
  queue.push(kViews, 2, picture(2));
  queue.push(kThumbnails, 3, picture(3));
  EXPECT_EQ(queue.pop(), picture(2));
  EXPECT_EQ(queue.pop(), picture(3));
  EXPECT_EQ(queue.pop(), std::nullopt);
  EXPECT_EQ(queue.dropped(), 1);
}

// A view that moves and the refined one after it are rendered at once. Before, the former replaced
// the latter where it ended last, and the page waited for the refined picture forever.
TEST(PictureQueue, AnOlderPictureNeitherReplacesNorFollowsANewerOne) {
  PictureQueue queue;
  queue.push(kViews, 10, picture(10));
  queue.push(kViews, 9, picture(9));
  EXPECT_EQ(queue.pop(), picture(10));
  queue.push(kViews, 8, picture(8));
  EXPECT_EQ(queue.pop(), std::nullopt);
  EXPECT_EQ(queue.dropped(), 2);
}

TEST(PictureQueue, ARequestMayHaveSeveralPictures) {
  PictureQueue queue;
  queue.push(kViews, 4, picture(1));
  EXPECT_EQ(queue.pop(), picture(1));
  queue.push(kViews, 4, picture(2));
  EXPECT_EQ(queue.pop(), picture(2));
}

TEST(PictureQueue, StreamsHaveTheirOwnOrder) {
  PictureQueue queue;
  queue.push(kViews, 9, picture(9));
  queue.push(kThumbnails, 2, picture(2));
  EXPECT_EQ(queue.pop(), picture(9));
  EXPECT_EQ(queue.pop(), picture(2));
}

}  // namespace
}  // namespace raystage::replay
