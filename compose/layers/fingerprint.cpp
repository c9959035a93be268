// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/fingerprint.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <bit>
#include <new>

namespace raystage::compose {

struct Fingerprint::State {
  XXH3_state_t* hash = XXH3_createState();

  State() {
    if (hash == nullptr) throw std::bad_alloc();
    XXH3_128bits_reset(hash);
  }
  ~State() { XXH3_freeState(hash); }
  State(const State& other) : State() { XXH3_copyState(hash, other.hash); }
  State& operator=(const State&) = delete;

  void add(std::string_view bytes) { XXH3_128bits_update(hash, bytes.data(), bytes.size()); }
};

Fingerprint::Fingerprint() : state_(std::make_unique<State>()) {}
Fingerprint::~Fingerprint() = default;
Fingerprint::Fingerprint(const Fingerprint& other)
    : state_(std::make_unique<State>(*other.state_)) {}

Fingerprint& Fingerprint::text(std::string_view label, std::string_view value) {
  state_->add(fmt::format("{}:{}:", label, value.size()));
  state_->add(value);
  state_->add("\n");
  return *this;
}

Fingerprint& Fingerprint::integer(std::string_view label, std::int64_t value) {
  return text(label, fmt::format("{}", value));
}

Fingerprint& Fingerprint::number(std::string_view label, double value) {
  return text(label, fmt::format("{:016x}", std::bit_cast<std::uint64_t>(value + 0.0)));
}

std::string Fingerprint::hex() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(state_->hash);
  return fmt::format("{:016x}{:016x}", hash.high64, hash.low64);
}

}  // namespace raystage::compose
