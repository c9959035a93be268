// SPDX-License-Identifier: Apache-2.0
// Replaces pages that cannot be read by zeros in a handler of SIGBUS. The handler finds the range
// of an address in a table of fixed size, which it reads without locks: signal handlers reach only
// static data and may not wait.
#include "base/mapped_range.h"

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdint>

#include "base/error.h"

namespace raystage {
namespace {

constexpr std::size_t kMaxRanges = 4096;
constexpr std::size_t kNone = kMaxRanges;

struct Slot {
  std::atomic<bool> taken = false, has_unread_pages = false;
  std::atomic<std::uint32_t> changes = 0;  ///< odd while begin and end change
  std::atomic<std::uintptr_t> begin = 0, end = 0;
};

std::array<Slot, kMaxRanges>& slots() {
  static constinit std::array<Slot, kMaxRanges> all;
  return all;
}

/// The handler that was there before.
struct sigaction& former_action() {
  static constinit struct sigaction action {};
  return action;
}

/// Only the owner of a slot changes it.
void set_range(Slot& slot, std::uintptr_t begin, std::uintptr_t end) {
  ++slot.changes;
  slot.begin = begin;
  slot.end = end;
  ++slot.changes;
}

/// Replaces the pages from `address` to the end of its range. Returns false if it is in none.
bool replace_by_zeros(std::uintptr_t address) {
  for (Slot& slot : slots()) {
    // Both of the same range. That of this address does not change: somebody reads it.
    const std::uint32_t before = slot.changes;
    const std::uintptr_t begin = slot.begin, end = slot.end;
    if (before % 2 != 0 || slot.changes != before) continue;
    if (address < begin || address >= end) continue;
    const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
    const std::uintptr_t first = address / page * page;
    slot.has_unread_pages = true;
    return mmap(reinterpret_cast<void*>(first), end - first, PROT_READ,
                MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE, -1, 0) != MAP_FAILED;
  }
  return false;
}

void handle(int signal, siginfo_t* info, void* context) {
  const int error = errno;
  const bool is_ours = replace_by_zeros(reinterpret_cast<std::uintptr_t>(info->si_addr));
  errno = error;
  if (is_ours) return;
  const struct sigaction& former = former_action();
  if ((former.sa_flags & SA_SIGINFO) != 0) {
    former.sa_sigaction(signal, info, context);
  } else if (former.sa_handler != SIG_DFL && former.sa_handler != SIG_IGN) {
    former.sa_handler(signal);
  } else {
    std::signal(signal, SIG_DFL);
    raise(signal);  // also where another process sent it
  }
}

bool install_handler() {
  struct sigaction action {};
  action.sa_sigaction = handle;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK;
  sigemptyset(&action.sa_mask);
  return sigaction(SIGBUS, &action, &former_action()) == 0;
}

}  // namespace

MappedRange::MappedRange(std::span<const std::byte> bytes) : slot_(kNone) {
  if (bytes.empty()) return;
  static const bool installed = install_handler();
  if (!installed) {
    throw Error::from_errno("the handler for truncated files cannot be installed", "SIGBUS",
                            "Check that the system permits it");
  }
  for (std::size_t i = 0; i < kMaxRanges; ++i) {
    Slot& slot = slots()[i];
    if (slot.taken.exchange(true)) continue;
    slot.has_unread_pages = false;
    set_range(slot, reinterpret_cast<std::uintptr_t>(bytes.data()),
              reinterpret_cast<std::uintptr_t>(bytes.data() + bytes.size()));
    slot_ = i;
    return;
  }
  throw Error::failed("more than 4096 files are mapped", "the process",
                      "Read fewer files at the same time");
}

MappedRange::~MappedRange() {
  if (slot_ == kNone) return;
  Slot& slot = slots()[slot_];
  set_range(slot, 0, 0);
  slot.taken = false;
}

bool MappedRange::has_unread_pages() const {
  return slot_ != kNone && slots()[slot_].has_unread_pages;
}

}  // namespace raystage
