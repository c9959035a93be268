// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>
#include <string>

namespace raystage::testing {

/// Returns the number of cases of each format: RAYSTAGE_ATTACK_CASES, or 25.
int attack_case_count();

/// Returns a text with one to four changes: bytes, cuts, repetitions, and numbers at the limits.
std::string mutated_text(std::string text, std::mt19937& random);

/// Returns binary data with one to four changes: bytes, cuts, repetitions, and 32-bit integers at
/// the limits, more often in the first 500 bytes, where headers are.
std::string mutated_bytes(std::string bytes, std::mt19937& random);

/// Returns a packed frame (docs/formats/archive.md) with one to four changes that know its boxes:
/// sizes at the limits, other types, boxes that are lost, repeated or exchanged, another statement
/// of size and XXH3, and changes within a box.
std::string mutated_packed_frame(const std::string& frame, std::mt19937& random);

}  // namespace raystage::testing
