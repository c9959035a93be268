// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"

namespace raystage::render {

/// Returns the method `lumigraph`: render_lumigraph() on the surface that its options `proxy` and
/// `mesh` choose. It is the focal plane, a mesh with the plane behind it, or the camera depths of
/// the method `depth`. This is a separate library, so that render_lumigraph() does not depend on
/// depths.
const Method& lumigraph_method();

}  // namespace raystage::render
