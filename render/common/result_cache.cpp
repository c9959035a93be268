// SPDX-License-Identifier: Apache-2.0
// Caches results by key with a memory budget: least recently used results are evicted first. Each
// result is computed once, and waiting threads help with its loops
// (tbb::collaborative_call_once()). Cost: O(log results) per request; an eviction walks the list of
// results.
#include "render/common/result_cache.h"

#include <tbb/collaborative_call_once.h>

#include <exception>
#include <list>
#include <map>
#include <mutex>
#include <stop_token>
#include <vector>

#include "base/cancellation.h"

namespace raystage::render {
namespace {

struct Entry {
  tbb::collaborative_once_flag once;
  std::shared_ptr<const void> result;  // or, if `make` threw:
  std::exception_ptr error;
  std::size_t bytes = 0;
  std::list<std::string>::iterator place;  // in the order of use
};

}  // namespace

struct ResultCache::State {
  explicit State(std::size_t budget_bytes) : budget(budget_bytes) {}

  std::size_t budget;
  mutable std::mutex mutex;  // guards the following members and the entries
  std::map<std::string, std::shared_ptr<Entry>> entries;
  std::list<std::string> by_use;  // most recent first
  std::size_t bytes = 0;

  std::shared_ptr<Entry> entry(const std::string& key) {
    const std::scoped_lock lock(mutex);
    auto& found = entries[key];
    if (!found) {
      found = std::make_shared<Entry>();
      by_use.push_front(key);
      found->place = by_use.begin();
    } else {
      by_use.splice(by_use.begin(), by_use, found->place);
    }
    return found;
  }

  void keep(const std::string& key, const std::shared_ptr<Entry>& entry,
            const std::shared_ptr<const void>& result, std::size_t result_bytes) {
    std::vector<std::shared_ptr<const void>> dropped;  // freed after the lock
    const std::scoped_lock lock(mutex);
    entry->result = result;
    const auto kept = entries.find(key);
    if (kept == entries.end() || kept->second != entry) return;  // evicted meanwhile
    entry->bytes = result_bytes;
    bytes += result_bytes;
    for (auto place = by_use.end(); bytes > budget && place != by_use.begin();) {
      --place;
      const auto oldest = entries.find(*place);
      if (oldest->second->bytes == 0 || oldest->second == entry) continue;
      bytes -= oldest->second->bytes;
      dropped.push_back(oldest->second->result);
      entries.erase(oldest);
      place = by_use.erase(place);
    }
  }

  void fail(const std::string& key, const std::shared_ptr<Entry>& entry, std::exception_ptr error) {
    const std::scoped_lock lock(mutex);
    entry->error = std::move(error);
    const auto kept = entries.find(key);
    if (kept == entries.end() || kept->second != entry) return;
    by_use.erase(entry->place);
    entries.erase(kept);
  }
};

ResultCache::ResultCache(std::size_t budget_bytes)
    : state_(std::make_unique<State>(budget_bytes)) {}

ResultCache::~ResultCache() = default;

std::shared_ptr<const void> ResultCache::get_any(const std::string& key, const Make& make) {
  for (;;) {
    try {
      return get_or_make(key, make);
    } catch (const Cancelled&) {
      throw_if_cancelled();  // otherwise another thread was cancelled, whose result was awaited
    }
  }
}

std::shared_ptr<const void> ResultCache::get_or_make(const std::string& key, const Make& make) {
  const auto entry = state_->entry(key);
  // Waiting threads help with the loops inside. They cannot pick up a view there that waits for
  // this result, which would deadlock.
  const std::stop_token cancellation = current_cancellation();
  tbb::collaborative_call_once(entry->once, [&] {
    std::size_t bytes = 0;
    const CancellationScope scope(cancellation);
    try {
      const std::shared_ptr<const void> result = make(bytes);
      state_->keep(key, entry, result, bytes);
    } catch (...) {  // must not cross TBB
      state_->fail(key, entry, std::current_exception());
    }
  });
  const std::scoped_lock lock(state_->mutex);
  if (entry->error) std::rethrow_exception(entry->error);
  return entry->result;
}

std::size_t ResultCache::bytes_held() const {
  const std::scoped_lock lock(state_->mutex);
  return state_->bytes;
}

}  // namespace raystage::render
