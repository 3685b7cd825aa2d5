"""What an operator can set: a flag over a MESHCONV3D_* variable over the default."""

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

from service.models import DEFAULT_MODEL


class Settings(BaseSettings):
    """One typed field and one variable name for each setting, as MESHCONV3D_<FIELD>."""

    model_config = SettingsConfigDict(env_prefix="MESHCONV3D_")

    model: str = Field(default=DEFAULT_MODEL, description="Shipped model by name, or a model file.")
    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(default=8000, ge=0, le=65535, description="Port to listen on.")
    max_upload_bytes: int = Field(
        default=100 * 1024 * 1024, ge=1, description="Largest request body that is accepted."
    )
    workers: int = Field(default=2, ge=1, le=256, description="Meshes classified at the same time.")
