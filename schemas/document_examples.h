// SPDX-License-Identifier: Apache-2.0
// A valid document of each kind for the tests, and what becomes of changed ones.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace raystage::schemas {

/// Returns a valid document of a kind of `EveryDocument`, e.g. "rig". Unknown kinds give an import
/// manifest.
nlohmann::json example_document(const std::string& kind);

/// Returns a camera of rigs, import manifests and views, 640x480 pixels, `x` metres to the right.
nlohmann::json example_camera(const std::string& id, double x);

/// Returns a document of any kind, read and written again.
std::string rewritten_document(const std::string& kind, const std::string& text);

/// Returns the message of the error with which a document is refused, or "accepted".
std::string refusal_of(const std::string& kind, const nlohmann::json& document);

}  // namespace raystage::schemas
