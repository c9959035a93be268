// SPDX-License-Identifier: Apache-2.0
#include "schemas/matte_settings.h"

#include "schemas/shot.h"

namespace raystage::schemas {

std::string format_matte(const MatteSettings& matte) { return json_from(matte).dump(); }

}  // namespace raystage::schemas
