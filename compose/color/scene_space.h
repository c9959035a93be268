// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace raystage::compose {

/// Colour space of light fields and mesh files, and the default working space of shots: linear
/// light, Rec.709 primaries. The name is that of ASWF's ColorInterop list.
inline constexpr std::string_view kSceneSpace = "lin_rec709_scene";

}  // namespace raystage::compose
