// SPDX-License-Identifier: Apache-2.0
// Adds values per pixel over hosts by reduce-scatter, then gather: each host adds a part of the
// rows and returns the sums to the hosts that have values there. A sample crosses the network at
// most twice, whatever the number of hosts.
#include "render/depth/host_reduction.h"

#include <algorithm>

#include "render/depth/host_messages.h"

namespace raystage::render::depth {
namespace {

using Message = RankCommunicator::Message;

std::size_t count(const HostReduction::Columns& columns) {
  return static_cast<std::size_t>(columns.end - columns.begin);
}

}  // namespace

HostReduction::Rows HostReduction::rows_of(std::size_t host) const {
  const auto hosts = static_cast<std::size_t>(group_.size());
  return {columns_.size() * host / hosts, columns_.size() * (host + 1) / hosts};
}

Message HostReduction::message_of(std::span<const float> values, std::size_t channels,
                                  Rows rows) const {
  const auto columns = std::span(columns_).subspan(rows.begin, rows.end - rows.begin);
  std::size_t samples = 0;
  for (const Columns& in_row : columns) samples += count(in_row);
  Message message;
  message.reserve(columns.size_bytes() + samples * channels * sizeof(float) +
                  RankCommunicator::kTrailerBytes);
  append_values(columns, message);
  for (std::size_t row = rows.begin; row < rows.end; ++row) {
    const std::size_t at = row * width_ + columns_[row].begin;
    append_values(values.subspan(channels * at, channels * count(columns_[row])), message);
  }
  return message;
}

std::vector<HostReduction::Columns> HostReduction::add(const Message& message, std::size_t channels,
                                                       Rows rows, std::span<float> sums) const {
  std::span<const std::byte> rest(message);
  std::vector<Columns> columns = take_values<Columns>(rest, rows.end - rows.begin);
  std::vector<float> values(channels * width_);
  for (std::size_t row = 0; row < columns.size(); ++row) {
    const Columns in_row = columns[row];
    if (in_row.begin < 0 || in_row.end < in_row.begin ||
        static_cast<std::size_t>(in_row.end) > width_) {
      throw Error::failed("a message from another host has columns outside the view",
                          "method depth", "Check that all hosts run the same program");
    }
    const auto part = std::span(values).first(channels * count(in_row));
    take_values(rest, part);
    const std::size_t at = channels * (row * width_ + in_row.begin);
    for (std::size_t i = 0; i < part.size(); ++i) sums[at + i] += part[i];
  }
  return columns;
}

void HostReduction::sum(std::span<float> values, int channels) const {
  const auto hosts = static_cast<std::size_t>(group_.size());
  if (hosts == 1) return;
  const auto per_pixel = static_cast<std::size_t>(channels);
  std::vector<Message> messages;
  for (std::size_t host = 0; host < hosts; ++host) {
    messages.push_back(message_of(values, per_pixel, rows_of(host)));
  }
  const std::vector<Message> parts = group_.exchange(std::move(messages));

  const Rows mine = rows_of(static_cast<std::size_t>(group_.rank()));
  std::vector<float> sums((mine.end - mine.begin) * width_ * per_pixel, 0.0F);
  std::vector<std::vector<Columns>> columns_of_host;
  for (const Message& part : parts) columns_of_host.push_back(add(part, per_pixel, mine, sums));
  messages.assign(hosts, {});
  for (std::size_t host = 0; host < hosts; ++host) {
    std::size_t samples = 0;
    for (const Columns& in_row : columns_of_host[host]) samples += count(in_row);
    messages[host].reserve(samples * per_pixel * sizeof(float) + RankCommunicator::kTrailerBytes);
    for (std::size_t row = 0; row < columns_of_host[host].size(); ++row) {
      const Columns in_row = columns_of_host[host][row];
      const std::size_t at = row * width_ + in_row.begin;
      append_values(std::span<const float>(sums).subspan(per_pixel * at, per_pixel * count(in_row)),
                    messages[host]);
    }
  }
  const std::vector<Message> replies = group_.exchange(std::move(messages));
  for (std::size_t host = 0; host < hosts; ++host) {
    std::span<const std::byte> rest(replies[host]);
    const Rows rows = rows_of(host);
    for (std::size_t row = rows.begin; row < rows.end; ++row) {
      const std::size_t at = row * width_ + columns_[row].begin;
      take_values(rest, values.subspan(per_pixel * at, per_pixel * count(columns_[row])));
    }
  }
}

void HostReduction::reduce_to_first(std::span<float> values) const {
  const auto hosts = static_cast<std::size_t>(group_.size());
  if (hosts == 1) return;
  const Rows all{0, columns_.size()};
  std::vector<Message> messages(hosts);
  if (group_.rank() != 0) messages[0] = message_of(values, 1, all);
  const std::vector<Message> received = group_.exchange(std::move(messages));
  if (group_.rank() != 0) return;
  for (std::size_t host = 1; host < hosts; ++host) add(received[host], 1, all, values);
}

}  // namespace raystage::render::depth
