// SPDX-License-Identifier: Apache-2.0
// Writes a take as a bag (RFC 8493, BagIt 1.0), by itself or as the content of an OCFL 1.1 object.
// Layout: docs/formats/bag.md. Input: a take; output: a new folder. Cost: each file is read once
// and its copy once more, with one SHA-256 (and one SHA-512 for OCFL) per byte.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/run_status.h"
#include "schemas/event_document.h"
#include "store/bagit/tag_files.h"
#include "store/take.h"

namespace raystage::store {

struct BagOptions {
  bool is_ocfl = false;    ///< the bag becomes v1/content of an OCFL object
  std::string identifier;  ///< External-Identifier, and id of the object; empty: take_identifier()
  std::vector<BagInfo::Element> info;    ///< further elements of bag-info.txt
  std::string program, version;          ///< Bag-Software-Agent, and the agent of events
  std::filesystem::path representation;  ///< see copy_representation()
  std::function<void(double)> progress;  ///< called with the share done, 0 to 1, from any thread
  /// Called with the fixity check that found the take damaged or not closed, before the Error.
  std::function<void(const schemas::TakeEvent&)> on_damage;
  std::stop_token stop;
};

struct BagWriteReport {
  std::string identifier;
  std::uint64_t files = 0, bytes = 0;  ///< of the payload
  std::uint64_t tag_files = 0;
  std::vector<schemas::TakeEvent> events;  ///< of this run, which the take's log does not have yet
  std::uint64_t damaged_log_lines = 0;     ///< of the take's event log
  RunStatus status = RunStatus::kNotRun;
};

/// Returns the identity of a take as a URI: its name and its time 0, by which manifests and copies
/// of a take are told apart as well: "x-raystage-take:NAME/2026-01-01T00:00:00Z".
std::string take_identifier(const Take& take);

/// Throws Error (bad input) if a label or value cannot be written to bag-info.txt, or if the label
/// is one that write_bag() writes.
void check_bag_info(const std::vector<BagInfo::Element>& elements);

/// Writes a bag of all files of a take but hidden ones and depth/. The copy is verified frame by
/// frame against its XXH3, flushed to disk, and gets its name when it is complete. The take is not
/// modified. Throws Error (bad input) if the take is damaged or not closed, `folder` exists or is
/// in the take, as check_bag_info() and files_of_take(), and Error (failed) if the disk fails or it
/// was stopped.
BagWriteReport write_bag(const Take& take, const std::filesystem::path& folder,
                         const BagOptions& options);

}  // namespace raystage::store
