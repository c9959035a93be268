// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <OpenColorIO/OpenColorIO.h>

namespace raystage {

/// See ColorConfig::built_in(). Made of OpenColorIO's own transforms alone: no file, no table.
OCIO_NAMESPACE::ConstConfigRcPtr built_in_color_config();

}  // namespace raystage
