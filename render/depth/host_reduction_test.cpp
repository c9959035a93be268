// SPDX-License-Identifier: Apache-2.0
// Tests of sums over hosts that are threads, compared with plain sums of all their values.
#include "render/depth/host_reduction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>

#include "base/error.h"
#include "render/depth/host_messages.h"
#include "testing/render/thread_communicators.h"

namespace raystage::render::depth {
namespace {

struct HostValues {
  std::vector<HostReduction::Columns> columns;
  std::vector<float> values;
};

/// Returns values in columns of some rows; some rows, and the whole last host, have none.
HostValues random_values(int width, int height, int channels, bool is_empty, std::mt19937& random) {
  HostValues host;
  host.values.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
                         static_cast<std::size_t>(channels),
                     0.0F);
  std::uniform_int_distribution<int> column(0, width);
  std::uniform_real_distribution<float> value(-1, 1);
  for (int y = 0; y < height; ++y) {
    const int a = column(random), b = column(random);
    const HostReduction::Columns columns{std::min(a, b),
                                         is_empty ? std::min(a, b) : std::max(a, b)};
    host.columns.push_back(columns);
    for (int x = columns.begin * channels; x < columns.end * channels; ++x) {
      host.values[y * width * channels + x] = value(random);
    }
  }
  return host;
}

std::vector<HostValues> random_hosts(int hosts, int width, int height, int channels) {
  std::mt19937 random(static_cast<unsigned>(hosts * 1000 + width));
  std::vector<HostValues> all;
  for (int host = 0; host < hosts; ++host) {
    all.push_back(random_values(width, height, channels, host > 0 && host == hosts - 1, random));
  }
  return all;
}

/// Returns the sum in the order of the hosts, as HostReduction adds.
std::vector<float> plain_sum(const std::vector<HostValues>& all, std::size_t first = 0) {
  std::vector<float> sums(all[0].values.size(), 0.0F);
  if (first > 0) sums = all[0].values;
  for (std::size_t host = first; host < all.size(); ++host) {
    for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += all[host].values[i];
  }
  return sums;
}

template <class Body>
void on_each_host(int hosts, const Body& body) {
  testing::ThreadCommunicators all(hosts);
  std::vector<std::jthread> threads;
  for (int host = 0; host < hosts; ++host) {
    threads.emplace_back([&, host] {
      const testing::ThreadCommunicators::Group group(all, host);
      body(group, static_cast<std::size_t>(host));
    });
  }
}

TEST(HostReduction, EqualPlainSumsInEachHostsColumns) {
  for (const int hosts : {1, 2, 3, 8}) {
    for (const int height : {1, 2, 7, 33}) {
      for (const int channels : {1, 4}) {
        constexpr int kWidth = 19;
        std::vector<HostValues> all = random_hosts(hosts, kWidth, height, channels);
        const std::vector<float> expected = plain_sum(all);
        on_each_host(hosts, [&](const RankCommunicator& group, std::size_t host) {
          HostReduction(group, kWidth, all[host].columns).sum(all[host].values, channels);
        });
        for (const HostValues& host : all) {
          for (int y = 0; y < height; ++y) {
            const HostReduction::Columns in_row = host.columns[y];
            for (int x = 0; x < kWidth * channels; ++x) {
              const auto i = static_cast<std::size_t>(y * kWidth * channels + x);
              const bool is_inside = x >= in_row.begin * channels && x < in_row.end * channels;
              ASSERT_EQ(host.values[i], is_inside ? expected[i] : 0.0F)
                  << hosts << " hosts, row " << y << " of " << height << ", value " << x;
            }
          }
        }
      }
    }
  }
}

TEST(HostReduction, OfTheFirstAreThoseOfAll) {
  for (const int hosts : {1, 2, 5}) {
    constexpr int kWidth = 23, kHeight = 9;
    std::vector<HostValues> all = random_hosts(hosts, kWidth, kHeight, 1);
    const std::vector<HostValues> before = all;
    on_each_host(hosts, [&](const RankCommunicator& group, std::size_t host) {
      HostReduction(group, kWidth, all[host].columns).reduce_to_first(all[host].values);
    });
    EXPECT_EQ(all[0].values, plain_sum(before, 1));
    for (std::size_t host = 1; host < all.size(); ++host) {
      EXPECT_EQ(all[host].values, before[host].values);
    }
  }
}

/// A host that receives arbitrary messages.
class SentBy : public RankCommunicator {
 public:
  explicit SentBy(Message message) : message_(std::move(message)) {}
  int rank() const override { return 0; }
  int size() const override { return 2; }
  std::vector<Message> exchange(std::vector<Message> messages) const override {
    return {std::move(messages[0]), message_};
  }

 private:
  Message message_;
};

TEST(HostReduction, RefuseMessagesThatDoNotFit) {
  constexpr int kWidth = 4;
  const auto sum_with = [&](std::vector<HostReduction::Columns> columns, std::size_t samples) {
    RankCommunicator::Message message;
    append_values(std::span<const HostReduction::Columns>(columns), message);
    append_values(std::span<const float>(std::vector<float>(samples, 1.0F)), message);
    std::vector<float> values(kWidth, 0.0F);
    HostReduction(SentBy(message), kWidth, {{0, kWidth}}).reduce_to_first(values);
    return values;
  };
  EXPECT_EQ(sum_with({{1, 3}}, 2), (std::vector<float>{0, 1, 1, 0}));
  EXPECT_THROW(sum_with({{1, 3}}, 1), Error);
  EXPECT_THROW(sum_with({{3, 5}}, 2), Error);
  EXPECT_THROW(sum_with({{-1, 1}}, 2), Error);
  EXPECT_THROW(sum_with({{3, 1}}, 2), Error);
  EXPECT_THROW(sum_with({}, 0), Error);
}

}  // namespace
}  // namespace raystage::render::depth
