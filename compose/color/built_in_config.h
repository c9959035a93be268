// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenColorIO/OpenColorIO.h>

namespace raystage::compose {

/// Returns the config of ColorConfig::built_in(), made of OpenColorIO's built-in transforms only.
OCIO_NAMESPACE::ConstConfigRcPtr built_in_color_config();

}  // namespace raystage::compose
