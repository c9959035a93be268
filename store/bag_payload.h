// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace raystage::store {

/// Returns whether a take is the payload of a bag (RFC 8493: data/ beside bagit.txt), which every
/// file that is added, changed or renamed in it makes invalid.
bool is_bag_payload(const std::filesystem::path& take);

/// Throws Error (bad input) if a take is the payload of a bag.
void require_no_bag_payload(const std::filesystem::path& take);

}  // namespace raystage::store
