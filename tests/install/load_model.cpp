// SPDX-License-Identifier: Apache-2.0
// load_model MODEL.onnx: prints the file that the module for networks was loaded from.
#include <dkb_slam/detector.h>
#include <dkb_slam/errors.h>

#include <fstream>
#include <iostream>

int main(int, char** argv) try {
  dkb::DetectorChoice choice;
  choice.kinds = "yolo";
  choice.model = argv[1];
  choice.inference = "opencv";
  const dkb::Detectors detectors = dkb::make_detectors(choice, dkb::Camera());
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    if (line.find("libdkb_onnx.so") == std::string::npos) continue;
    std::cout << line.substr(line.find('/')) << "\n";
    return detectors.slow != nullptr ? 0 : 1;
  }
  return 1;
} catch (const dkb::InputError& error) {
  std::cerr << "error: " << error.what() << "\n";
  return 2;
}
