// An EGL as some devices have it: without a window system, and for OpenGL ES alone. context_test opens it by name.
#include <EGL/egl.h>
#include <EGL/eglext.h>

namespace {

int the_display;

}  // namespace

extern "C" {

EGLint eglGetError() { return EGL_SUCCESS; }

const char* eglQueryString(EGLDisplay display, EGLint name) {
  if (name == EGL_CLIENT_APIS) return "OpenGL_ES";
  return display == EGL_NO_DISPLAY ? "EGL_EXT_client_extensions EGL_MESA_platform_surfaceless" : "EGL_KHR_surfaceless_context";
}

EGLDisplay eglGetPlatformDisplay(EGLenum, void*, const EGLAttrib*) { return &the_display; }
EGLBoolean eglInitialize(EGLDisplay, EGLint*, EGLint*) { return EGL_TRUE; }
EGLBoolean eglTerminate(EGLDisplay) { return EGL_TRUE; }
EGLBoolean eglBindAPI(EGLenum api) { return api == EGL_OPENGL_ES_API ? EGL_TRUE : EGL_FALSE; }
EGLBoolean eglChooseConfig(EGLDisplay, const EGLint*, EGLConfig*, EGLint, EGLint*) { return EGL_FALSE; }
EGLContext eglCreateContext(EGLDisplay, EGLConfig, EGLContext, const EGLint*) { return EGL_NO_CONTEXT; }
EGLBoolean eglDestroyContext(EGLDisplay, EGLContext) { return EGL_FALSE; }
EGLBoolean eglMakeCurrent(EGLDisplay, EGLSurface, EGLSurface, EGLContext) { return EGL_FALSE; }
EGLContext eglGetCurrentContext() { return EGL_NO_CONTEXT; }
__eglMustCastToProperFunctionPointerType eglGetProcAddress(const char*) { return nullptr; }
}
