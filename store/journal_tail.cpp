// SPDX-License-Identifier: Apache-2.0
#include "store/journal_tail.h"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "base/error.h"
#include "base/posix_file.h"
#include "store/journal.h"
#include "store/matroska.h"

namespace raystage::store {
namespace {

constexpr std::uint64_t kMaxBytesPerRead = std::uint64_t{4} << 20;

std::vector<std::byte> read_part(const ContainedPath& file, std::uint64_t offset,
                                 std::uint64_t bytes) {
  std::vector<std::byte> part(bytes);
  part.resize(read_file_part(file, offset, part));
  return part;
}

std::uint64_t size_of(const ContainedPath& file) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file.path(), error);
  return error ? 0 : size;
}

/// Returns the version of a journal; 0 if it has no intact header.
std::uint32_t version_of(const ContainedPath& journal) {
  const auto header =
      journal::decode_header(read_part(journal, 0, journal::kHeaderBytes), journal.path().string());
  return header ? header->version : 0;
}

bool has_possible_time(const FrameRecord& record) {
  return record.time_ns >= 0 && record.time_ns <= matroska::kMaxTime;
}

}  // namespace

JournalTail::JournalTail(ContainedPath journal, std::size_t first_records)
    : journal_(std::move(journal)), first_records_(first_records) {}

std::vector<FrameRecord> JournalTail::read() {
  std::vector<FrameRecord> records;
  const std::uint64_t size = size_of(journal_);
  if (size < journal::kHeaderBytes) return records;
  if (version_ == 0) {
    version_ = version_of(journal_);
    if (version_ == 0) return records;
    const std::uint64_t count = (size - journal::kHeaderBytes) / journal::record_bytes(version_);
    position_ = journal::kHeaderBytes + (count - std::min<std::uint64_t>(count, first_records_)) *
                                            journal::record_bytes(version_);
  }
  const std::uint64_t each = journal::record_bytes(version_);
  if (size < position_ + each) return records;
  const std::uint64_t count = std::min(size - position_, kMaxBytesPerRead) / each;
  const std::vector<std::byte> part = read_part(journal_, position_, count * each);
  for (std::size_t at = 0; at + each <= part.size(); at += each) {
    position_ += each;
    const auto record = journal::decode_record(std::span(part).subspan(at, each), version_);
    if (record && has_possible_time(*record)) records.push_back(*record);
  }
  return records;
}

std::optional<TimeRange> journal_time_range(const ContainedPath& journal) {
  const std::uint32_t version = version_of(journal);
  if (version == 0) return std::nullopt;
  const std::uint64_t each = journal::record_bytes(version), size = size_of(journal);
  const std::uint64_t count = (size - journal::kHeaderBytes) / each;
  if (count == 0) return std::nullopt;
  const auto record = [&](std::uint64_t index) {
    const auto bytes = read_part(journal, journal::kHeaderBytes + index * each, each);
    return bytes.size() == each ? journal::decode_record(bytes, version) : std::nullopt;
  };
  const auto first = record(0), last = record(count - 1);
  if (!first || !last || !has_possible_time(*first) || !has_possible_time(*last)) {
    return std::nullopt;
  }
  return TimeRange{first->time_ns, last->time_ns};
}

}  // namespace raystage::store
