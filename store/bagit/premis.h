// SPDX-License-Identifier: Apache-2.0
// PREMIS 3 (Data Dictionary for Preservation Metadata, Library of Congress) as XML: the take as a
// representation, its files with sizes, digests and formats, what happened to it, and the programs
// that did so.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "schemas/event_document.h"

namespace raystage::store {

/// A file of a take in a package.
struct PremisFile {
  std::string path;    ///< relative to the take
  std::string stored;  ///< relative to the package, as its identifier: "data/..."
  std::uint64_t bytes = 0;
  std::string sha256;  ///< 64 hexadecimal digits
};

/// Returns the XML document, in UTF-8. Bytes that XML cannot hold become U+FFFD. `identifier`: of
/// the take.
std::string premis_as_xml(const std::string& identifier, const std::string& take_name,
                          std::span<const PremisFile> files,
                          std::span<const schemas::TakeEvent> events);

}  // namespace raystage::store
