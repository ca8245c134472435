// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

// The C interface between the library and the module that holds OpenCV's DNN (libdkb_onnx.so). Linked directly, DNN
// would cost every run 9 MB and 25 shared libraries; so the module is loaded with the first network.
// No exception crosses it: failures are texts written to `error`, always terminated.
extern "C" {

struct DkbOnnxTensor {
  const float* data;  // owned by the network, valid until its next forward() or close()
  int rank;
  int dims[6];
};

struct DkbOnnxApi {
  // Parses an ONNX file's bytes. Null when that fails.
  void* (*open)(const char* bytes, size_t size, char* error, size_t error_size);
  // Runs the network on a blob of 1 x 3 x height x width floats. Returns the number of float tensors put out (at most
  // `capacity` of rank <= 6 are written), or -1.
  int (*forward)(void* network, const float* blob, int width, int height, DkbOnnxTensor* outputs, int capacity,
                 char* error, size_t error_size);
  void (*close)(void* network);
};

// The one symbol looked up. The number in its name changes with the interface.
__attribute__((visibility("default"))) const DkbOnnxApi* dkb_onnx_api_1();

}  // extern "C"
