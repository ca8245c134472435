// SPDX-License-Identifier: Apache-2.0
// `PROGRAM FILE.oni` records 20 images of OpenNI's dummy driver. For tests.
#include <OpenNI.h>
#include <unistd.h>

int main(int argc, char** argv) {
  using namespace openni;
  Device device;
  VideoStream colour, depth;
  Recorder recorder;
  const auto good = [](Status status) { return status == STATUS_OK; };
  if (argc != 2 || !good(OpenNI::initialize()) || !good(device.open("Dummy")) ||
      !good(colour.create(device, SENSOR_COLOR)) || !good(depth.create(device, SENSOR_DEPTH)) ||
      !good(recorder.create(argv[1])) || !good(recorder.attach(colour)) || !good(recorder.attach(depth)) ||
      !good(recorder.start()) || !good(colour.start()) || !good(depth.start()))
    _exit(1);
  VideoStream* streams[] = {&colour, &depth};
  for (int i = 0; i < 20; ++i) {
    int ready = 0;
    VideoFrameRef frame;
    if (!good(OpenNI::waitForAnyStream(streams, 2, &ready, 2000)) || !good(streams[ready]->readFrame(&frame))) _exit(1);
  }
  recorder.stop();
  recorder.destroy();
  _exit(0);  // the driver's threads do not survive an orderly end
}
