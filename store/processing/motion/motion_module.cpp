// SPDX-License-Identifier: Apache-2.0
#include "store/processing/motion/motion_module.h"

#include "base/module_file.h"

namespace raystage::store {

const MotionModule& motion_module() {
  static const std::unique_ptr<const MotionModule> module(reinterpret_cast<OpenMotionModule*>(
      load_module(kMotionModule, kOpenMotionModule, "motion cannot be estimated"))());
  return *module;
}

}  // namespace raystage::store
