// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/frame_pages.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <random>
#include <vector>

namespace raystage::store {
namespace {

JpegLayout layout_of(int width, int height) {
  JpegLayout layout;
  layout.width = width;
  layout.height = height;
  layout.mcu_width = 16;
  layout.mcu_height = 8;
  layout.mcus_per_row = (width + 15) / 16;
  layout.mcu_rows = (height + 7) / 8;
  return layout;
}

/// Fresh pages of the system.
class Pages {
 public:
  explicit Pages(std::size_t bytes)
      : bytes_(bytes),
        data_(mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)) {
    if (data_ == MAP_FAILED) throw std::bad_alloc();
    madvise(data_, bytes_, MADV_NOHUGEPAGE);
  }
  ~Pages() { munmap(data_, bytes_); }
  Pages(const Pages&) = delete;
  Pages& operator=(const Pages&) = delete;

  std::uint16_t* data() const { return static_cast<std::uint16_t*>(data_); }
  /// Returns for each page whether memory holds it.
  std::vector<bool> resident() const {
    const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    std::vector<unsigned char> state((bytes_ + page - 1) / page);
    EXPECT_EQ(mincore(data_, bytes_, state.data()), 0);
    std::vector<bool> result;
    for (const unsigned char one : state) result.push_back((one & 1) != 0);
    return result;
  }

 private:
  std::size_t bytes_;
  void* data_;
};

TEST(FramePages, HoldsThePagesOfWantedMcusAndFewOthers) {
  constexpr int kWide = 4096, kRows = 64;  // a row takes eight pages
  const JpegLayout layout = layout_of(kWide, kRows);
  McuMask wanted(static_cast<std::size_t>(layout.mcus_per_row) * layout.mcu_rows, 0);
  wanted[2 * layout.mcus_per_row + 100] = 1;  // rows 16 to 23, columns 1600 to 1615
  const Pages pages(std::size_t{kWide} * kRows * 8);
  request_pages({pages.data(), std::size_t{kWide} * kRows * 4}, layout, wanted);
  const std::vector<bool> resident = pages.resident();
  const Pages probe(1);
  if (sysconf(_SC_PAGESIZE) != 4096 || madvise(probe.data(), 1, MADV_POPULATE_WRITE) != 0) {
    GTEST_SKIP() << "this kernel has no such request, or other pages";
  }
  for (int y = 16; y < 24; ++y) EXPECT_TRUE(resident[y * 8 + 3]) << y;
  EXPECT_EQ(std::ranges::count(resident, true), 8);
}

TEST(FramePages, KeepsTheValues) {
  std::mt19937 random(5);
  for (const auto& [width, height] : {std::pair{1, 1}, {16, 8}, {37, 21}, {960, 50}, {5000, 9}}) {
    const JpegLayout layout = layout_of(width, height);
    std::vector<std::uint16_t> rgba(static_cast<std::size_t>(width) * height * 4);
    std::ranges::generate(rgba, [&] { return static_cast<std::uint16_t>(random()); });
    const std::vector<std::uint16_t> before = rgba;
    for (const unsigned share : {0U, 1U, 5U, 10U}) {
      McuMask wanted(static_cast<std::size_t>(layout.mcus_per_row) * layout.mcu_rows);
      std::ranges::generate(wanted, [&] { return random() % 10 < share ? 1 : 0; });
      request_pages(rgba, layout, wanted);
      EXPECT_EQ(rgba, before);
    }
    request_pages(rgba, layout, {});
    EXPECT_EQ(rgba, before);
  }
}

}  // namespace
}  // namespace raystage::store
