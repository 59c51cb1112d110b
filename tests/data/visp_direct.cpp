// Direct calls of ViSP, as its users write them, for tests/test_stack_adapters.py.
//
//   c++ -O2 -std=c++17 visp_direct.cpp -o visp_direct -lvisp_core -lvisp_visual_features -lvisp_vs
//     -lvisp_robot
//
// It reads numbers from standard input, matrices row by row:
//   points (1) or pose (0), desired (1) or current (0) interaction matrix;
//   gain at zero error, gain at infinity, slope at zero error;
//   avoidance (1) or none (0), rho, rho1, lambda_tune; saturation (1) or none (0);
//   n; ranges, lower and upper (n each); greatest speeds (n);
//   focal lengths and principal point of the camera [px]; pose of the camera in the tip (4 x 4);
//   m; markers (m x 3); pose of the target in the camera at the goal (4 x 4); its pixels (m x 2);
//   number of states; for each of them
//     q (n); Jacobian of the tip in its own axes (6 x n); pose of the target in the camera (4 x 4);
//     pixels (m x 2).
// It writes n joint speeds for each state.

#include <visp3/core/vpPoint.h>
#include <visp3/robot/vpRobot.h>
#include <visp3/visual_features/vpFeaturePoint.h>
#include <visp3/visual_features/vpFeatureThetaU.h>
#include <visp3/visual_features/vpFeatureTranslation.h>
#include <visp3/vs/vpAdaptiveGain.h>
#include <visp3/vs/vpServo.h>

#include <iostream>
#include <stdexcept>
#include <vector>

double number() {
  double value;
  if (!(std::cin >> value)) throw std::runtime_error("the input ends too early");
  return value;
}

unsigned count() { return static_cast<unsigned>(number()); }

vpColVector vector(unsigned n) {
  vpColVector values(n);
  for (unsigned i = 0; i < n; ++i) values[i] = number();
  return values;
}

vpMatrix matrix(unsigned rows, unsigned columns) {
  vpMatrix M(rows, columns);
  for (unsigned i = 0; i < rows; ++i)
    for (unsigned j = 0; j < columns; ++j) M[i][j] = number();
  return M;
}

vpHomogeneousMatrix pose() {
  const vpMatrix M = matrix(4, 4);
  vpTranslationVector t(M[0][3], M[1][3], M[2][3]);
  vpRotationMatrix R;
  for (unsigned i = 0; i < 3; ++i)
    for (unsigned j = 0; j < 3; ++j) R[i][j] = M[i][j];
  return vpHomogeneousMatrix(t, R);
}

// Markers in the image: x and y from the pixels, Z from the pose of the target in the camera.
std::vector<vpFeaturePoint> features(const vpColVector& camera, const vpMatrix& markers,
                                     const vpHomogeneousMatrix& cMo, const vpMatrix& pixels) {
  std::vector<vpFeaturePoint> found(markers.getRows());
  for (unsigned i = 0; i < found.size(); ++i) {
    vpPoint marker(markers[i][0], markers[i][1], markers[i][2]);
    marker.changeFrame(cMo);
    const double x = (pixels[i][0] - camera[2]) / camera[0];
    const double y = (pixels[i][1] - camera[3]) / camera[1];
    found[i].buildFrom(x, y, marker.get_Z());
  }
  return found;
}

int main() {
  std::cout.precision(17);
  const bool by_points = count() == 1;
  const bool desired = count() == 1;
  const double at_zero = number();
  const double at_infinity = number();
  const double slope = number();
  const bool avoids = count() == 1;
  const double rho = number();
  const double rho1 = number();
  const double lambda_tune = number();
  const bool saturates = count() == 1;
  const unsigned n = count();
  const vpColVector lower = vector(n);
  const vpColVector upper = vector(n);
  const vpColVector fastest = vector(n);
  const vpColVector camera = vector(4);
  const vpHomogeneousMatrix eMc = pose();
  const unsigned m = count();
  const vpMatrix markers = matrix(m, 3);
  const vpHomogeneousMatrix cdMo = pose();
  std::vector<vpFeaturePoint> wanted = features(camera, markers, cdMo, matrix(m, 2));
  for (unsigned states = count(); states > 0; --states) {
    const vpColVector q = vector(n);
    const vpMatrix eJe = matrix(6, n);
    const vpHomogeneousMatrix cMo = pose();
    std::vector<vpFeaturePoint> seen = features(camera, markers, cMo, matrix(m, 2));
    vpHomogeneousMatrix cdMc = cdMo * cMo.inverse();
    vpFeatureTranslation translation(cdMc, vpFeatureTranslation::cdMc);
    vpFeatureThetaU rotation(cdMc, vpFeatureThetaU::cdRc);
    vpServo task;
    task.setServo(vpServo::EYEINHAND_L_cVe_eJe);
    task.setInteractionMatrixType(desired ? vpServo::DESIRED : vpServo::CURRENT);
    task.setLambda(vpAdaptiveGain(at_zero, at_infinity, slope));
    task.set_cVe(vpVelocityTwistMatrix(eMc.inverse()));
    task.set_eJe(eJe);
    if (by_points) {
      for (unsigned i = 0; i < m; ++i) task.addFeature(seen[i], wanted[i]);
    } else {
      task.addFeature(translation);
      task.addFeature(rotation);
    }
    vpColVector qd = task.computeControlLaw();
    if (avoids)
      qd += task.secondaryTaskJointLimitAvoidance(q, qd, lower, upper, rho, rho1, lambda_tune);
    if (saturates) qd = vpRobot::saturateVelocities(qd, fastest);
    for (unsigned j = 0; j < n; ++j) std::cout << qd[j] << (j + 1 < n ? " " : "\n");
  }
}
